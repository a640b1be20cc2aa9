//! Farthest-point sampling: each next point is the one farthest from all before it (Eldar,
//! Lindenbaum, Porat and Zeevi 1997).
//!
//! Points are sorted along a space-filling curve into blocks with boxes. A sample can lower
//! distances in a block only if it is closer to the box than the block's largest distance so far;
//! other blocks are skipped, so that all samples together cost a few passes.

use crate::morton::morton_order;
use crate::simd::{LANES, Lanes, grouped, multiversion};
use cager_geometry::mesh::Point;
use cager_geometry::spatial::Aabb;
use rayon::prelude::*;

/// Points of one block.
const BLOCK_POINTS: usize = 32 * LANES;
/// Blocks per task.
const TASK_BLOCKS: usize = 64;

/// Adds points to `start` until there are `count`, and says how far the farthest point is from its
/// nearest sample. Ties go to the point that comes first along the curve.
pub(crate) fn farthest_points(points: &[Point], start: &[u32], count: usize) -> (Vec<u32>, f64) {
    let (mut blocks, place) = sorted_blocks(points);
    let mut samples = Vec::with_capacity(count);
    while samples.len() < count {
        let next = match start.get(samples.len()) {
            Some(&sample) => sample,
            None => match farthest(&blocks) {
                Some((squared, next)) if squared >= 0.0 => next,
                _ => break,
            },
        };
        let p = points[next as usize];
        let place = place[next as usize] as usize;
        blocks[place / BLOCK_POINTS].take(place % BLOCK_POINTS, p);
        blocks.par_chunks_mut(TASK_BLOCKS).for_each(|blocks| blocks.iter_mut().for_each(|block| block.add(p)));
        samples.push(next);
    }
    (samples, farthest(&blocks).map_or(0.0, |(squared, _)| squared.max(0.0).sqrt()))
}

fn farthest(blocks: &[Block]) -> Option<(f64, u32)> {
    let best = blocks.iter().reduce(|a, b| if b.farthest > a.farthest { b } else { a })?;
    Some((best.farthest, best.ids[best.farthest_at]))
}

/// A block of neighbouring points with its bounding box.
struct Block {
    around: Aabb,
    ids: Vec<u32>,
    places: Vec<[Lanes; 3]>,
    /// Squared distances to the nearest sample; −1 for samples themselves and unused lanes.
    squared: Vec<Lanes>,
    /// The largest of them, and where it is.
    farthest: f64,
    farthest_at: usize,
}

impl Block {
    fn new(points: &[Point], ids: &[u32]) -> Self {
        let own: Vec<Point> = ids.iter().map(|&i| points[i as usize]).collect();
        let around = Aabb::around_all(&own);
        let mut squared = vec![Lanes::splat(-1.0); own.len().div_ceil(LANES)];
        (0..own.len()).for_each(|i| squared[i / LANES].0[i % LANES] = f64::INFINITY);
        let (ids, places) = (ids.to_vec(), grouped(&own, [0.0; 3]));
        Self { around, ids, places, squared, farthest: f64::INFINITY, farthest_at: 0 }
    }

    /// Marks the point at this place as a sample.
    fn take(&mut self, place: usize, p: Point) {
        self.squared[place / LANES].0[place % LANES] = -1.0;
        self.update(p);
    }

    fn add(&mut self, p: Point) {
        // Rounding may make a box seem as far as the points in it.
        if self.around.distance2(p.into()) * (1.0 - 1e-12) < self.farthest {
            self.update(p);
        }
    }

    fn update(&mut self, p: Point) {
        self.farthest_at = update_nearest(&self.places, &mut self.squared, &p);
        self.farthest = self.squared[self.farthest_at / LANES].0[self.farthest_at % LANES];
    }
}

multiversion! {
    /// Lowers the squared distances to those to `p`; returns the index of the largest.
    fn update_nearest(places: &[[Lanes; 3]], squared: &mut [Lanes], p: &Point) -> usize {
        let p = [Lanes::splat(p[0]), Lanes::splat(p[1]), Lanes::splat(p[2])];
        let (mut largest, mut group_of) = (Lanes::splat(-2.0), Lanes::ZERO);
        for (g, (place, squared)) in places.iter().zip(squared).enumerate() {
            let d = [place[0] - p[0], place[1] - p[1], place[2] - p[2]];
            let to_p = d[0] * d[0] + d[1] * d[1] + d[2] * d[2];
            *squared = squared.zip(to_p, |old, new| if new < old { new } else { old });
            for l in 0..LANES {
                let longer = squared.0[l] > largest.0[l];
                group_of.0[l] = if longer { g as f64 } else { group_of.0[l] };
                largest.0[l] = if longer { squared.0[l] } else { largest.0[l] };
            }
        }
        let mut at = (largest.0[0], group_of.0[0] as usize * LANES);
        for l in 1..LANES {
            let here = (largest.0[l], group_of.0[l] as usize * LANES + l);
            if here.0 > at.0 || (here.0 == at.0 && here.1 < at.1) {
                at = here;
            }
        }
        at.1
    }
}

/// All points in blocks along the Morton curve, and the position of each point on it.
fn sorted_blocks(points: &[Point]) -> (Vec<Block>, Vec<u32>) {
    let ids = morton_order(points);
    let mut place = vec![0; ids.len()];
    ids.iter().enumerate().for_each(|(at, &id)| place[id as usize] = at as u32);
    (ids.par_chunks(BLOCK_POINTS).map(|ids| Block::new(points, ids)).collect(), place)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn noise(count: usize) -> Vec<Point> {
        let mut random = fastrand::Rng::with_seed(0);
        let mut next = move || 2.0 * random.f64() - 1.0;
        (0..count).map(|_| [next(), 0.3 * next(), 2.0 * next() * next()]).collect()
    }

    #[test]
    fn the_samples_are_those_of_the_plain_algorithm() {
        let points = noise(5_000);
        let start = [7, 4_999, 30];
        let (found, reach) = farthest_points(&points, &start, 200);
        let squared = |a: Point, b: Point| (0..3).map(|k| (a[k] - b[k]).powi(2)).sum::<f64>();
        let mut distances = vec![f64::INFINITY; points.len()];
        let mut samples: Vec<u32> = Vec::new();
        while samples.len() < 200 {
            let next = match start.get(samples.len()) {
                Some(&i) => i,
                None => (0..points.len()).max_by(|&a, &b| distances[a].total_cmp(&distances[b])).unwrap() as u32,
            };
            samples.push(next);
            for (d, &p) in distances.iter_mut().zip(&points) {
                *d = d.min(squared(p, points[next as usize]));
            }
        }
        assert_eq!(found, samples);
        assert!((reach - distances.iter().copied().fold(0.0, f64::max).sqrt()).abs() < 1e-15);
    }

    #[test]
    fn coincident_points_are_sampled_once_there_is_nothing_else_left() {
        let mut points = noise(40);
        points.extend_from_within(..20);
        let (found, reach) = farthest_points(&points, &[3], 60);
        assert_eq!(reach, 0.0);
        let mut places: Vec<_> = found[..40].iter().map(|&i| i % 40).collect();
        places.sort_unstable();
        assert_eq!(places, (0..40).collect::<Vec<_>>(), "every place before any twice");
    }
}
