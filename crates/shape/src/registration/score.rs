//! How well a template lies on a surface.

use cager_geometry::vector::Point;
use glam::DVec3;
use rayon::prelude::*;

use super::matching::{KnownMatches, OrientedPoints};
use super::target::{NORMAL_LENGTH, Target};
use super::template::Template;
use crate::points::{matrix, plain};

/// Distances count no more than this in a score, as a share of the diagonal.
const MAX_SCORED: f64 = 0.05;
/// One observed point in so many is scored.
const SCORED_EVERY: usize = 5;

impl Template {
    /// How well the template lies on a surface in a cage: the root mean square, both ways, of the distance from the plane of the nearest point and of the difference of
    /// normals together, as a share of the diagonal; distances beyond 5 % count as 5 %.
    pub fn score(&self, target: &Target, cage: &[Point]) -> f64 {
        self.score_from(target, cage, 1, &mut self.unmatched(target))
    }

    /// [`Self::score`] of one point in so many (0 counts as 1), whose matches are looked for near the last ones, unless these are of a surface of another
    /// number of points.
    pub fn score_from(&self, target: &Target, cage: &[Point], every: usize, known: &mut KnownMatches) -> f64 {
        let every = every.max(1);
        known.keep_if_of(self.samples.len(), target.points.len());
        let (positions, normals) = self.samples_in(matrix(cage).as_ref());
        let samples = OrientedPoints::new(&plain(&positions), &plain(&normals), target.normal_length);
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
