//! How far a template lies from an observed surface, and back.

use super::surfaces::Seen;
use cager_geometry::mesh::{Point, TriMesh};
use cager_geometry::spatial::{Nearest, Surface};
use cager_shape::registration::{NearestPoints, welded};
use rayon::prelude::*;
use std::collections::HashMap;

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

/// A template farther from the observed points than this share of the diagonal is nowhere near.
const NOWHERE_NEAR: f64 = 0.2;

/// Whether most points of template and surface have none of the other's near.
pub(super) fn is_elsewhere(
    samples: &[Point],
    observed: &[Point],
    from_surface: Option<Distances>,
    diagonal: f64,
) -> bool {
    // What this measures is seldom far, and looked at more closely only then.
    if from_surface.is_none_or(|distances| distances.mean < NOWHERE_NEAR) {
        return false;
    }
    let is_far = |points: &[Point], others: &[Point]| {
        let tree = NearestPoints::new(others.iter().copied());
        let far = points.iter().filter(|&&p| tree.nearest(p).1 > (NOWHERE_NEAR * diagonal).powi(2));
        2 * far.count() > points.len()
    };
    is_far(samples, observed) && is_far(observed, samples)
}

/// Observed points that are measured to the template, at the most.
const MAX_MEASURED: usize = 5000;

/// Distances of a frame, place by place.
pub(super) struct Looked {
    /// From each sample of the template to the observed surface; empty of a cloud.
    there: Vec<f64>,
    /// Samples that have nothing beside them since the surface ends there.
    at_rim: Vec<bool>,
    /// From observed points to the template, and the point of it that is nearest.
    pub(super) back: Vec<(Point, f64, u32)>,
}

impl Looked {
    /// Of samples of a template.
    pub(super) fn at(template: &TriMesh, samples: &[Point], seen: &Seen, diagonal: f64) -> Self {
        let found: Vec<Option<Nearest>> = seen.surface.as_ref().map_or_else(Vec::new, |surface| {
            samples.par_iter().with_min_len(64).map(|&p| surface.nearest(p.into())).collect()
        });
        let there: Vec<f64> = found.iter().map(|found| found.map_or(f64::NAN, |found| found.distance)).collect();
        let is_far = |&d: &f64| d > SEEN_WITHIN * diagonal;
        let rim = seen.surface.as_ref().filter(|_| there.iter().any(is_far)).map(rim);
        let at_rim = |found: &Option<Nearest>| match (found, &seen.surface, &rim) {
            (Some(found), Some(surface), Some(rim)) => {
                let corners = surface.triangles[found.face as usize].into_iter().zip(found.weights);
                corners.filter(|&(_, weight)| weight > 1e-9).all(|(v, _)| rim[v as usize])
            }
            _ => false,
        };
        let at_rim = found.iter().map(at_rim).collect();
        let observed = &seen.observation.points;
        let every = observed.len().div_ceil(MAX_MEASURED).max(1);
        let template = Surface::from(template);
        let back = observed.par_iter().step_by(every).with_min_len(64).map(|&p| {
            let found = template.nearest(p.into());
            let heaviest = |found: &Nearest| (0..3).max_by(|&a, &b| found.weights[a].total_cmp(&found.weights[b]));
            let vertex =
                found.map_or(0, |found| template.triangles[found.face as usize][heaviest(&found).unwrap_or(0)]);
            (p, found.map_or(f64::NAN, |found| found.distance), vertex)
        });
        Self { there, at_rim, back: back.collect() }
    }

    /// From the template to the surface, which a cloud has none, and back.
    pub(super) fn distances(&self, diagonal: f64) -> (Option<Distances>, Option<Distances>) {
        let there = (!self.there.is_empty()).then(|| Distances::new(self.there.clone(), diagonal)).flatten();
        (there, Distances::new(self.back.iter().map(|&(_, d, _)| d).collect(), diagonal))
    }

    /// Samples with a surface beside them, and how far it is.
    pub(super) fn beside(&self) -> impl Iterator<Item = (usize, f64)> {
        let all = self.there.iter().copied().zip(&self.at_rim).enumerate();
        all.filter(|(_, (d, at_rim))| d.is_finite() && !**at_rim).map(|(sample, (d, _))| (sample, d))
    }
}

/// Where the surface ends is looked at if some samples are farther than this share of the diagonal.
const SEEN_WITHIN: f64 = 0.005;

/// The vertices at which a surface ends: those of edges that a single triangle has.
fn rim(surface: &Surface) -> Vec<bool> {
    let places: Vec<Point> = surface.vertices.iter().map(glam::DVec3::to_array).collect();
    let first = welded(&places);
    let mut edges: HashMap<[u32; 2], u32> = HashMap::with_capacity(2 * surface.triangles.len());
    for triangle in &surface.triangles {
        let [a, b, c] = triangle.map(|v| first[v as usize]);
        for [a, b] in [[a, b], [b, c], [c, a]] {
            *edges.entry([a.min(b), a.max(b)]).or_default() += 1;
        }
    }
    let mut rim = vec![false; places.len()];
    edges
        .iter()
        .filter(|(_, count)| **count == 1)
        .for_each(|(edge, _)| edge.iter().for_each(|&v| rim[v as usize] = true));
    first.iter().map(|&v| rim[v as usize]).collect()
}
