//! Where a moved target stands: on the floor where the source does, sliding only as it does.

use cager_geometry::mesh::Point;
use glam::DVec3;

use crate::canonical::size;

/// Points below this height over the floor may stand on it, as a share of the target's size.
const LOW: f64 = 0.02;
/// Points that move by less stand, as a share of the mean motion in that time, however many frames
/// a second has.
const STILL: f64 = 0.25;
/// More points than these must stand for a contact.
const MIN_STANDING: usize = 5;

/// Finds by how much each frame of a target is to be moved, so that its lowest point is as far over
/// the floor as the source's, and what stands does not slide. Frames come in order; corrections are
/// smoothed over one frame.
pub struct Placement {
    up: DVec3,
    size: f64,
    floor: f64,
    /// How much higher the target's lowest point is than the source's, at rest.
    higher: f64,
    before: Option<(Vec<Point>, Vec<Point>)>,
    by: Vec<DVec3>,
    rises: Vec<f64>,
}

impl Placement {
    /// For a target at rest, the source's points under it in its space, and the height of the
    /// floor, below which none of these ever is ([`lowest`]). `up` is a unit vector.
    pub fn new(target: &[Point], under: &[Point], floor: f64, up: Point) -> Self {
        let higher = lowest(target, up) - lowest(under, up);
        let (size, up) = (size(target), up.into());
        Self { up, size, floor, higher, before: None, by: Vec::new(), rises: Vec::new() }
    }

    /// The next frame: the target's points, and the source's under them.
    pub fn push(&mut self, shape: &[Point], under: &[Point]) {
        let up = self.up.to_array();
        self.rises.push(lowest(under, up) + self.higher - lowest(shape, up));
        let last = self.by.last().copied().unwrap_or(DVec3::ZERO);
        let slide = self.before.as_ref().map_or(DVec3::ZERO, |before| self.slide(before, shape, under));
        self.by.push(last + slide);
        self.before = Some((shape.to_vec(), under.to_vec()));
    }

    /// How much further the target's standing points must go than they did.
    fn slide(&self, before: &(Vec<Point>, Vec<Point>), shape: &[Point], under: &[Point]) -> DVec3 {
        let moved = |v: usize| DVec3::from(under[v]) - DVec3::from(before.1[v]);
        let mean = (0..under.len()).map(|v| moved(v).length()).sum::<f64>() / under.len().max(1) as f64;
        let (mut sum, mut count) = (DVec3::ZERO, 0_usize);
        for v in 0..shape.len() {
            let moved = moved(v);
            let height = DVec3::from(under[v]).dot(self.up);
            if height < self.floor + LOW * self.size && moved.length() <= STILL * mean {
                sum += moved - (DVec3::from(shape[v]) - DVec3::from(before.0[v]));
                count += 1;
            }
        }
        if count > MIN_STANDING { sum / count as f64 } else { DVec3::ZERO }
    }

    /// By how much each frame is to be moved.
    pub fn offsets(&self) -> Vec<Point> {
        let mean = self.by.iter().sum::<DVec3>() / self.by.len().max(1) as f64;
        let each = self.by.iter().zip(&self.rises).map(|(by, rise)| {
            let by = *by - mean;
            by + (rise - by.dot(self.up)) * self.up
        });
        smoothed(&each.collect::<Vec<_>>()).iter().map(DVec3::to_array).collect()
    }
}

/// The least height of some points.
pub fn lowest(points: &[Point], up: Point) -> f64 {
    points.iter().map(|&p| DVec3::from(p).dot(up.into())).fold(f64::INFINITY, f64::min)
}

/// A Gaussian of one frame's width; the first and last value go on beyond the ends.
fn smoothed(values: &[DVec3]) -> Vec<DVec3> {
    const REACH: i64 = 4;
    let weights: Vec<f64> = (-REACH..=REACH).map(|k| (-0.5 * (k * k) as f64).exp()).collect();
    let total: f64 = weights.iter().sum();
    let last = values.len() as i64 - 1;
    let at = |t: i64| values[t.clamp(0, last) as usize];
    let mean = |t: i64| (-REACH..=REACH).zip(&weights).map(|(k, w)| *w * at(t + k)).sum::<DVec3>() / total;
    (0..=last).map(mean).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn feet_that_stand_at_the_source_stay_where_they_are() {
        let foot: Vec<Point> = (0..20).map(|k| [0.01 * f64::from(k), 0.0, 0.0]).chain([[0.0, 0.0, 1.0]]).collect();
        let moved = |x: f64, z: f64| foot.iter().map(|p| [p[0] + x, p[1], p[2] + z]).collect::<Vec<Point>>();
        let mut placement = Placement::new(&foot, &foot, 0.0, [0.0, 0.0, 1.0]);
        let shapes: Vec<_> = (0..30).map(|t| moved(0.02 * f64::from(t), 0.1)).collect();
        shapes.iter().for_each(|shape| placement.push(shape, &foot));
        let offsets = placement.offsets();
        let first: Vec<f64> = (5..25).map(|t| shapes[t][0][0] + offsets[t][0]).collect();
        assert!(first.iter().all(|x| (x - first[0]).abs() < 1e-12), "{first:?}");
        assert!(offsets.iter().all(|by| (by[2] + 0.1).abs() < 1e-12));
    }
    #[test]
    fn it_does_not_matter_how_many_frames_a_second_has() {
        // A body that walks on, the foot of which stands while the target's slides.
        let foot: Vec<Point> = (0..20).map(|k| [0.01 * f64::from(k), 0.0, 0.0]).collect();
        let body: Vec<Point> = (0..60).map(|k| [0.0, 0.02 * f64::from(k), 1.0]).collect();
        let at = |time: f64, slide: f64| -> Vec<Point> {
            let foot = foot.iter().map(|p| [p[0] + slide * time, p[1], p[2]]);
            foot.chain(body.iter().map(|p| [p[0] + time, p[1], p[2]])).collect()
        };
        let last = |rate: f64| {
            let mut placement = Placement::new(&at(0.0, 0.0), &at(0.0, 0.0), 0.0, [0.0, 0.0, 1.0]);
            for frame in 0..=(2.0 * rate) as u32 {
                let time = f64::from(frame) / rate;
                placement.push(&at(time, 0.1), &at(time, 0.05));
            }
            placement.by.last().copied().unwrap()
        };
        let wanted = DVec3::new(2.0 * (0.05 - 0.1), 0.0, 0.0);
        for rate in [3.0, 30.0, 240.0] {
            assert!(last(rate).distance(wanted) < 1e-9, "{rate}: {}", last(rate));
        }
    }
}
