//! How far a template lies from an observed surface, and back.

use super::surfaces::Followed;
use cager_geometry::mesh::{Point, TriMesh};
use cager_geometry::spatial::Surface;
use cager_registration::NearestPoints;

/// Distances between a template and an observed surface, as shares of the diagonal.
#[derive(Clone, Copy, Debug, serde::Serialize)]
pub struct Distances {
    /// From points of one to the other, on average.
    pub mean: f64,
    /// Root of the mean square.
    pub rms: f64,
    /// Ninety-five of a hundred are nearer.
    pub percentile_95: f64,
    /// The largest.
    pub largest: f64,
}

impl Distances {
    /// None without points.
    pub(super) fn new(mut distances: Vec<f64>, diagonal: f64) -> Option<Self> {
        distances.sort_by(f64::total_cmp);
        let count = distances.len();
        let mean = |of: fn(f64) -> f64| distances.iter().map(|&d| of(d / diagonal)).sum::<f64>() / count as f64;
        Some(Self {
            mean: mean(|d| d),
            rms: mean(|d| d * d).sqrt(),
            percentile_95: distances.get(count * 95 / 100)? / diagonal,
            largest: distances.last()? / diagonal,
        })
    }
}

/// A template that lies farther from the observed points than this share of the diagonal, as they do from it, is nowhere near.
const NOWHERE_NEAR: f64 = 0.2;

/// Whether most points of both, the template's and the observed ones, have none of the other's near.
pub(super) fn is_elsewhere(samples: &[Point], seen: &Followed, from_surface: Option<Distances>, diagonal: f64) -> bool {
    // What this measures is seldom far, and looked at more closely only then.
    if from_surface.is_none_or(|distances| distances.mean < NOWHERE_NEAR) {
        return false;
    }
    let observed: Vec<Point> = seen.target.points().iter().map(glam::DVec3::to_array).collect();
    let is_far = |points: &[Point], others: &[Point]| {
        let tree = NearestPoints::new(others.iter().copied());
        let far = points.iter().filter(|&&p| tree.nearest(p).1 > (NOWHERE_NEAR * diagonal).powi(2));
        2 * far.count() > points.len()
    };
    is_far(samples, &observed) && is_far(&observed, samples)
}

/// Observed points that are measured to the template, at the most.
const MAX_MEASURED: usize = 5000;

/// Distances from the template to the observed surface, which a cloud has none, and back.
pub(super) fn distances(
    template: &TriMesh,
    samples: &[Point],
    seen: &Followed,
    diagonal: f64,
) -> (Option<Distances>, Option<Distances>) {
    use rayon::prelude::*;
    let to = |surface: &Surface, points: &[glam::DVec3]| -> Vec<f64> {
        points.par_iter().with_min_len(64).map(|&p| surface.nearest(p).map_or(f64::NAN, |n| n.distance)).collect()
    };
    let samples: Vec<glam::DVec3> = samples.iter().map(|&p| p.into()).collect();
    let there = seen.surface.as_ref().and_then(|surface| Distances::new(to(surface, &samples), diagonal));
    let every = seen.target.points().len().div_ceil(MAX_MEASURED).max(1);
    let observed: Vec<glam::DVec3> = seen.target.points().iter().copied().step_by(every).collect();
    (there, Distances::new(to(&Surface::from(template), &observed), diagonal))
}
