//! Watches the frames of a capture as they are read: from some frame on, points may come in another
//! order, in another unit or mirrored. A few hundred edges of each frame are compared with those of
//! the rest pose and of the frame before, and regions with those at rest.

use super::faces::FaceComparison;
use super::hand::{Mirroring, Regions};
use super::{described, neighbours, quartiles, relative_size};
use cager_geometry::mesh::{Model, Point, Polygons};
use cager_geometry::vector::{distance, sub};
use std::fmt;

/// Edges compared, and points looked at beside their ends, at the most.
const EDGES: usize = 256;
const POINTS: usize = 1 << 16;

/// Ratios of units that no model grows or shrinks by from one frame to the next.
const UNITS: [f64; 7] = [25.4, 30.48, 39.37, 100.0, 304.8, 1000.0, 1e6];

/// An edge is torn where it is this many times longer than before, for the size of its model.
const TORN: f64 = 2.5;

/// How a frame departs from those before it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Departure {
    /// Its points come in another order: how many times longer the edges are that are torn by it.
    Order(f64),
    /// Its faces are those of the rest pose with the points under other numbers.
    Faces,
    /// It is this many times as large as the frame before it.
    Units(f64),
    /// Left and right are exchanged: how the axes are, where that can be told.
    Mirrored(Option<Mirroring>),
}

impl fmt::Display for Departure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::Order(ratio) => {
                write!(f, "its points come in another order: edges of the rest pose are {ratio:.0} times longer in it")
            }
            Self::Faces => {
                f.write_str("its points come in another order: its faces have other numbers for the same points")
            }
            Self::Units(ratio) => {
                write!(f, "it is {} than what comes before it, as with other units", relative_size(ratio))
            }
            Self::Mirrored(mirroring) => {
                write!(f, "it is mirrored ({} in it), and what comes before it is not", described(mirroring))
            }
        }
    }
}

/// What is compared of every frame, and how it is in the rest pose.
#[derive(Debug)]
pub struct Watch {
    rest: Model,
    edges: Vec<[u32; 2]>,
    sketch: Sketch,
    regions: Regions,
}

impl Watch {
    /// `None` where there is nothing to compare: too few edges, or all points in one place.
    pub fn new(rest: &Model) -> Option<Self> {
        let all = neighbours(rest);
        let stride = all.len().div_ceil(EDGES).max(1);
        let edges: Vec<[u32; 2]> = all.into_iter().step_by(stride).collect();
        let sketch = Sketch::new(&edges, &rest.points).filter(|_| edges.len() >= 8)?;
        Some(Self { rest: rest.clone(), edges, sketch, regions: Regions::new(&rest.points) })
    }
}

/// One pass over frames in their order.
#[derive(Default)]
pub struct Progress {
    previous: Option<Sketch>,
    /// Faces of a frame that differ from those of the rest pose.
    other_faces: Option<(Polygons, FaceComparison)>,
    /// Whether the last frame that tells was mirrored.
    is_mirrored: bool,
}

impl Progress {
    /// Looks at the next frame, with the faces of its file where it has any.
    pub fn look(&mut self, watch: &Watch, frame: &[Point], faces: Option<&Polygons>) -> Option<Departure> {
        let sketch = Sketch::new(&watch.edges, frame)?;
        let previous = self.previous.take();
        let previous = previous.as_ref().unwrap_or(&watch.sketch);
        let found = sketch
            .in_other_units(previous, &watch.sketch)
            .or_else(|| sketch.in_another_order(previous, &watch.sketch))
            .or_else(|| self.renumbered(watch, frame, faces?, sketch.radius / watch.sketch.radius))
            .or_else(|| self.mirrored(watch, frame));
        self.previous = Some(sketch);
        found
    }

    /// Whether the frame looked at last is about as large as the rest pose.
    pub fn is_as_large_as_at_rest(&self, watch: &Watch) -> bool {
        self.previous.as_ref().is_none_or(|last| last.is_as_large_as(&watch.sketch))
    }

    /// That a frame is mirrored where those before were not.
    fn mirrored(&mut self, watch: &Watch, frame: &[Point]) -> Option<Departure> {
        let hand = watch.regions.hand(frame)?;
        let was_mirrored = std::mem::replace(&mut self.is_mirrored, hand.is_mirrored);
        (hand.is_mirrored && !was_mirrored).then(|| Departure::Mirrored(hand.mirroring()))
    }

    fn renumbered(&mut self, watch: &Watch, frame: &[Point], faces: &Polygons, scale: f64) -> Option<Departure> {
        let rest = &watch.rest;
        if faces.is_empty() || rest.faces.is_empty() || *faces == rest.faces {
            return None;
        }
        if self.other_faces.as_ref().is_none_or(|(known, _)| known != faces) {
            let compared = FaceComparison::new(&rest.faces, faces, rest.points.len());
            self.other_faces = Some((faces.clone(), compared));
        }
        let (_, compared) = self.other_faces.as_ref()?;
        compared.shows_another_order(&rest.points, frame, scale).then_some(Departure::Faces)
    }
}

/// Part of the points of a pose.
#[derive(Debug)]
struct Sketch {
    /// Ends of the edges.
    ends: Vec<[Point; 2]>,
    lengths: Vec<f64>,
    /// Points spread over the model's numbering.
    points: Vec<Point>,
    centre: Point,
    /// Median distance of the ends from their centre.
    radius: f64,
}

impl Sketch {
    /// `None` if the points lie in one place.
    fn new(edges: &[[u32; 2]], pose: &[Point]) -> Option<Self> {
        let ends: Vec<[Point; 2]> = edges.iter().map(|edge| edge.map(|end| pose[end as usize])).collect();
        let lengths = ends.iter().map(|&[a, b]| distance(a, b)).collect();
        let points: Vec<Point> = pose.iter().step_by(pose.len().div_ceil(POINTS).max(1)).copied().collect();
        // Medians, which some points far away do not move.
        let all = ends.as_flattened();
        let median = |value: &dyn Fn(&Point) -> f64| Some(quartiles(all.iter().map(value).collect())?[1]);
        let centre = [median(&|p| p[0])?, median(&|p| p[1])?, median(&|p| p[2])?];
        let radius = median(&|&p| distance(p, centre))?;
        (radius > 0.0).then_some(Self { ends, lengths, points, centre, radius })
    }

    /// About.
    fn is_as_large_as(&self, other: &Self) -> bool {
        (self.radius / other.radius).ln().abs() < 2_f64.ln()
    }

    /// A jump of all edges and of the extent alike by the ratio of two units, away from the rest
    /// pose's size. Growth takes several frames or other ratios.
    fn in_other_units(&self, previous: &Self, rest: &Self) -> Option<Departure> {
        if !previous.is_as_large_as(rest) || self.is_as_large_as(previous) {
            return None;
        }
        let extent = self.radius / previous.radius;
        let both = self.lengths.iter().zip(&previous.lengths).filter(|(_, before)| **before > 0.0);
        let [lower, edges, upper] = quartiles(both.map(|(now, before)| now / before).collect())?;
        let even = (upper / lower).ln() < 0.3 && (edges / extent).ln().abs() < 0.2;
        let away = edges.max(1.0 / edges);
        (even && UNITS.iter().any(|unit| (away / unit).ln().abs() < 0.05)).then_some(Departure::Units(edges))
    }

    /// Edges are torn although their ends lie where other points were; of points that fly apart
    /// they do not.
    fn in_another_order(&self, previous: &Self, rest: &Self) -> Option<Departure> {
        let torn = self.torn(previous, rest);
        let least = 8.max(self.lengths.len() / 20);
        if torn.len() < least {
            return None;
        }
        let [_, times, _] = quartiles(torn.iter().map(|(_, ratio)| *ratio).collect())?;
        // Points go less far from one frame to the next; but a torn frame says nothing.
        let is_whole = previous.torn(rest, rest).len() < least;
        let exchanged =
            is_whole && self.exchanges_points(previous, &torn, 0.03) || self.exchanges_points(rest, &torn, 0.2);
        exchanged.then_some(Departure::Order(times))
    }

    /// The edges that are torn beside two other poses, and how many times longer they are.
    fn torn(&self, one: &Self, other: &Self) -> Vec<(usize, f64)> {
        let relative = |sketch: &Self, k: usize| sketch.lengths[k] / sketch.radius;
        let ratio = |k: usize| relative(self, k) / relative(one, k).max(relative(other, k));
        (0..self.lengths.len()).map(|k| (k, ratio(k))).filter(|(_, ratio)| *ratio > TORN).collect()
    }

    /// Whether ends of torn edges, at least so far from their place, are where others were.
    fn exchanges_points(&self, before: &Self, torn: &[(usize, f64)], least: f64) -> bool {
        let place = |sketch: &Self, p: Point| sub(p, sketch.centre).map(|x| x / sketch.radius);
        let set: Vec<Point> = before.points.iter().map(|&p| place(before, p)).collect();
        let stride = torn.len().div_ceil(48).max(1);
        let (mut own, mut nearest) = (Vec::new(), Vec::new());
        for &(k, _) in torn.iter().step_by(stride) {
            for end in 0..2 {
                let now = place(self, self.ends[k][end]);
                own.push(distance(now, place(before, before.ends[k][end])));
                nearest.push(set.iter().map(|&p| distance(now, p)).fold(f64::INFINITY, f64::min));
            }
        }
        let (Some([_, own, _]), Some([_, nearest, _])) = (quartiles(own), quartiles(nearest)) else { return false };
        own > least && nearest < 0.15 * own
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::tube;
    use super::*;

    /// What the first frame is called that departs, of frames made from the rest pose.
    fn first(rest: &Model, frames: usize, change: impl Fn(usize, usize) -> Point) -> Option<(usize, Departure)> {
        let watch = Watch::new(rest).expect("edges");
        let mut progress = Progress::default();
        (0..frames).find_map(|t| {
            let frame: Vec<Point> = (0..rest.points.len()).map(|i| change(t, i)).collect();
            progress.look(&watch, &frame, None).map(|found| (t, found))
        })
    }

    fn both() -> [Model; 2] {
        let mesh = tube();
        let cloud = Model { points: mesh.points.clone(), ..Model::default() };
        [mesh, cloud]
    }

    fn bent(t: usize, [x, y, z]: Point) -> Point {
        [x + 0.3 * (t as f64 + y).sin(), y, z + 0.1 * (2.0 * t as f64).cos()]
    }

    #[test]
    fn motion_however_strong_is_no_departure() {
        for rest in both() {
            let at = |i: usize| rest.points[i];
            let scaled = |p: Point, by: f64| p.map(|x| by * x);
            assert_eq!(first(&rest, 9, |t, i| bent(t, at(i))), None, "bent");
            assert_eq!(first(&rest, 9, |t, i| scaled(at(i), 1.6_f64.powi(t as i32))), None, "growing");
            assert_eq!(first(&rest, 9, |t, i| scaled(at(i), 7.0_f64.powi(t as i32))), None, "growing fast");
            assert_eq!(first(&rest, 9, |t, i| scaled(at(i), 10.0_f64.powi(t as i32))), None, "tenfold");
            assert_eq!(
                first(&rest, 7, |t, i| scaled(at(i), 1.3 * 10.0_f64.powi(t as i32 - 6))),
                None,
                "out of nothing"
            );
            assert_eq!(first(&rest, 9, |t, i| if t == 4 { [0.0; 3] } else { at(i) }), None, "a frame in one place");
            assert_eq!(first(&rest, 9, |t, i| scaled(at(i), if t == 4 { 1e-9 } else { 1.0 })), None, "hidden");
            let spun = |t: usize, [x, y, z]: Point| if t.is_multiple_of(2) { [x, y, z] } else { [-x, 4.0 - y, z] };
            assert_eq!(first(&rest, 9, |t, i| spun(t, at(i))), None, "turned upside down");
            let squashed = |t: usize, [x, y, z]: Point| if t < 4 { [x, y, z] } else { [5.0 * x, 0.1 * y, 5.0 * z] };
            assert_eq!(first(&rest, 9, |t, i| squashed(t, at(i))), None, "squashed");
            let noise = |t: usize, i: usize| -> Point {
                let mut rng = fastrand::Rng::with_seed((t * 1000 + i) as u64);
                at(i).map(|x| x + (t as f64) * 0.4 * (rng.f64() - 0.5))
            };
            assert_eq!(first(&rest, 9, noise), None, "flying apart");
            let spikes = |t: usize, i: usize| if t > 3 && i.is_multiple_of(9) { [30.0, 20.0, i as f64] } else { at(i) };
            assert_eq!(first(&rest, 9, spikes), None, "spikes");
            let halves = |t: usize, i: usize| if t > 3 && i < 200 { scaled(at(i), -1.0) } else { at(i) };
            assert_eq!(first(&rest, 9, halves), None, "one part elsewhere");
        }
    }

    #[test]
    fn the_first_frame_in_another_unit_is_found() {
        for rest in both() {
            for unit in [1000.0, 100.0, 39.37, 25.4, 1.0 / 30.48, 0.01] {
                let scaled = |t: usize, i: usize| bent(t, rest.points[i]).map(|x| if t < 3 { x } else { unit * x });
                let found = first(&rest, 9, scaled);
                assert!(
                    matches!(found, Some((3, Departure::Units(ratio))) if (ratio / unit).ln().abs() < 0.05),
                    "{unit}: {found:?}"
                );
            }
        }
    }

    #[test]
    fn the_first_mirrored_frame_is_found() {
        for rest in both() {
            let mirrored = |t: usize, i: usize| {
                let [x, y, z] = bent(t, rest.points[i]);
                if t < 5 { [x, y, z] } else { [x, y, -z] }
            };
            let found = first(&rest, 9, mirrored);
            let told = found.map(|(frame, departure)| (frame, departure.to_string()));
            let what = "it is mirrored (z of the rest pose is -z in it), and what comes before it is not";
            assert_eq!(told, Some((5, what.to_owned())));
        }
    }

    #[test]
    fn the_first_frame_in_another_order_is_found() {
        for rest in both() {
            let n = rest.points.len();
            let mut shuffled: Vec<usize> = (0..n).collect();
            fastrand::Rng::with_seed(3).shuffle(&mut shuffled);
            let mut by_height: Vec<usize> = (0..n).collect();
            by_height.sort_by(|&a, &b| rest.points[a][0].total_cmp(&rest.points[b][0]));
            for order in [shuffled, by_height, (0..n).map(|i| i * 7919 % n).collect()] {
                let found = first(&rest, 9, |t, i| bent(t, rest.points[if t < 5 { i } else { order[i] }]));
                assert!(matches!(found, Some((5, Departure::Order(ratio))) if ratio > 2.5), "{found:?}");
            }
        }
    }

    #[test]
    fn other_numbers_in_the_faces_are_told_from_other_faces() {
        let rest = tube();
        let n = rest.points.len();
        let watch = Watch::new(&rest).expect("edges");
        let look = |points: &[Point], faces: &Polygons| Progress::default().look(&watch, points, Some(faces));
        let triangles = |turn: usize| {
            let mut faces = Polygons::new();
            for quad in rest.faces.iter() {
                let corner = |k: usize| quad[(k + turn) % 4];
                faces.push(&[corner(0), corner(1), corner(2)]);
                faces.push(&[corner(0), corner(2), corner(3)]);
            }
            faces
        };
        let listed: Vec<&[u32]> = rest.faces.iter().collect();
        let (mut reversed, mut some) = (Polygons::new(), Polygons::new());
        listed.iter().rev().for_each(|face| reversed.push(face));
        listed.iter().rev().take(300).for_each(|face| some.push(face));
        for faces in [triangles(0), triangles(1), reversed.clone(), some, Polygons::new()] {
            assert_eq!(look(&rest.points, &faces), None);
        }
        let split = Model { points: rest.points.clone(), faces: triangles(0), ..Model::default() };
        let watch_split = Watch::new(&split).expect("edges");
        assert_eq!(Progress::default().look(&watch_split, &rest.points, Some(&triangles(1))), None, "other diagonals");
        // Each point follows the next one: no edge is torn, and only the faces tell.
        let next: Vec<Point> = (0..n).map(|i| rest.points[(i + 1) % n]).collect();
        let names: Vec<u32> = (0..n).map(|i| ((i + n - 1) % n) as u32).collect();
        assert_eq!(look(&next, &rest.faces.renamed(&names)), Some(Departure::Faces));
        // The same with the faces listed in another order.
        let ends: Vec<Point> = (0..n).map(|i| rest.points[(i + n / 2) % n]).collect();
        let names: Vec<u32> = (0..n).map(|i| ((i + n - n / 2) % n) as u32).collect();
        assert_eq!(look(&ends, &reversed.renamed(&names)), Some(Departure::Faces));
    }
}
