//! How well a template lies on a surface.

use cager_geometry::vector::Point;
use glam::DVec3;
use rayon::prelude::*;

use super::matching::{KnownMatches, OrientedPoints};
use super::target::{NORMAL_LENGTH, Target};
use super::template::Template;
use crate::points::vectors;

/// Distances count no more than this in a score, as a share of the diagonal.
const MAX_SCORED: f64 = 0.05;
/// One observed point in so many is scored.
const SCORED_EVERY: usize = 5;

impl Template {
    /// How well the template lies on a surface in a cage, by one point in so many: the root mean
    /// square, both ways, of plane distance and difference of normals, as a share of the diagonal,
    /// 5 % at the most. Matches are looked for as in [`Self::fit`].
    pub fn score(&self, target: &Target, cage: &[Point], every: usize, known: &mut KnownMatches) -> f64 {
        known.keep_if_of(self.samples.len(), target.points.len());
        let (positions, normals) = self.samples_in(&vectors(cage));
        let samples = OrientedPoints::new(&positions, &normals, target.normal_length);
        let scored = |offset: DVec3, own: DVec3, other: DVec3, d2: f64| {
            let far = d2.sqrt() / self.diagonal;
            let plane = offset.dot(other) / self.diagonal;
            let turn = NORMAL_LENGTH * (own - other).length();
            if far > MAX_SCORED { MAX_SCORED } else { (plane * plane + turn * turn).sqrt().min(MAX_SCORED) }
        };
        let there: Vec<f64> = positions
            .par_iter()
            .zip(&normals)
            .zip(&mut known.there)
            .step_by(every)
            .with_min_len(64)
            .map(|((&p, &n), known)| {
                let (j, d2) = target.tree.nearest_again(p, n, known);
                scored(p - target.points[j], n, target.normals[j], d2)
            })
            .collect();
        let back: Vec<f64> = known
            .back
            .par_iter_mut()
            .enumerate()
            .step_by(SCORED_EVERY * every)
            .with_min_len(64)
            .map(|(k, known)| {
                let (point, normal) = (target.points[k], target.normals[k]);
                let (i, d2) = samples.nearest_again(point, normal, known);
                scored(point - positions[i], normal, normals[i], d2)
            })
            .collect();
        let mean = |distances: &[f64]| (distances.iter().map(|d| d * d).sum::<f64>() / distances.len() as f64).sqrt();
        mean(&there) + mean(&back)
    }
}
