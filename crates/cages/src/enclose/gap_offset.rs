//! An offset that is smaller beside thin gaps, which it leaves open.

use super::lattice::LEVELS;
use cager_geometry::spatial::{Aabb, Bvh};
use glam::DVec3;

/// Growth of the offset with the distance from a gap. Below 1, every point within the offset is
/// joined with the model by a straight line within it.
const GROWTH: f64 = 0.5;

/// The offset of a cage: the largest but near thin gaps, where it is a half to a quarter of half
/// the gap.
#[derive(Debug)]
pub(super) struct Offset {
    pub(super) largest: f64,
    gaps: Vec<Gaps>,
}

/// Places in gaps that ask for the same offset.
#[derive(Debug)]
struct Gaps {
    offset: f64,
    centers: Vec<DVec3>,
    tree: Bvh,
}

/// A ball that touches the model without containing any of it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Ball {
    pub(super) center: DVec3,
    pub(super) radius: f64,
}

impl Offset {
    /// The same offset everywhere.
    pub(super) fn uniform(largest: f64) -> Self {
        Self { largest, gaps: Vec::new() }
    }

    /// Leaves gaps open, but for those where it would be below `least` or an eighth of the largest.
    pub(super) fn around(balls: &[Ball], largest: f64, least: f64) -> Self {
        let mut gaps = Vec::new();
        for level in 1..=LEVELS {
            let offset = largest / f64::from(1 << level);
            let asked = |b: &&Ball| b.radius >= 2.0 * offset && (level == 1 || b.radius < 4.0 * offset);
            let centers: Vec<DVec3> = balls.iter().filter(asked).map(|b| b.center).collect();
            if !centers.is_empty() && offset >= least {
                let boxes: Vec<Aabb> = centers.iter().map(|&c| Aabb { low: c, high: c }).collect();
                gaps.push(Gaps { offset, tree: Bvh::new(&boxes), centers });
            }
        }
        Self { largest, gaps }
    }

    /// The offset for the surface near a place.
    pub(super) fn at(&self, p: DVec3) -> f64 {
        self.gaps.iter().fold(self.largest, |offset, gaps| {
            // Within two offsets of the centre, at the gap's sides, the offset is as asked for.
            let reach = 2.0 * gaps.offset + (offset - gaps.offset).max(0.0) / GROWTH;
            let nearest = gaps.tree.nearest(p, reach * reach, |i| gaps.centers[i as usize].distance_squared(p));
            nearest
                .map_or(offset, |(_, d2)| offset.min(gaps.offset + GROWTH * (d2.sqrt() - 2.0 * gaps.offset).max(0.0)))
        })
    }
}
