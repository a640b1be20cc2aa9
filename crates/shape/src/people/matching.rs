//! Matches of a template with what was observed, both ways, and how well it lies there by them.

use super::model::PersonModel;
use super::options::{DEVIATION, Method};
use crate::people::rig::QUADS;
use crate::registration::{Observation, OrientedPoints};
use cager_geometry::mesh::Point;
use glam::DVec3;
use rayon::prelude::*;

/// Length of a normal in matches, as a fraction of the template's diagonal.
pub(super) const NORMAL_LENGTH: f64 = 0.02;
/// Distances beyond this fraction of the height count no more in scores.
pub(super) const SCORE_CAP: f64 = 0.1;
/// Cosine of normals below which a match does not count.
pub(super) const MIN_COSINE: f64 = 0.2;
/// A sample keeps its observed point while it moves by no more than this fraction of the height.
const KEPT: f64 = 3e-4;
/// Queries that one task makes at the least.
const TASK: usize = 32;

/// An observation, ready to be matched.
pub(super) struct Observed<'a> {
    pub(super) observation: &'a Observation,
    pub(super) tree: OrientedPoints,
    /// Those of its points that are matched with the template.
    pub(super) chosen: Vec<usize>,
}

/// Which sample belongs to which observed point.
#[derive(Default)]
pub(super) struct Pairs {
    /// Where the samples were when their observed points were found.
    at: Vec<Point>,
    /// Of each sample, its observed point.
    forth: Vec<usize>,
    /// Of each chosen observed point, its sample.
    back: Vec<usize>,
}

/// A point of the template at the plane of an observed one.
pub(super) struct Match {
    pub(super) sample: usize,
    pub(super) normal: DVec3,
    pub(super) residual: f64,
    pub(super) distance: f64,
    pub(super) weight: f64,
}

/// How well a template lies on what was observed. Lengths are fractions of its height.
#[derive(Clone, Copy, Debug)]
pub(super) struct Score {
    /// Mean distance of matches, both ways, none beyond [`SCORE_CAP`].
    pub(super) mean: f64,
    /// That of the samples around each quad to what was observed.
    pub(super) parts: [f64; QUADS],
}

/// A template and an observation.
#[derive(Clone, Copy)]
pub(super) struct Matching<'a> {
    pub(super) model: &'a PersonModel,
    pub(super) method: Method,
    pub(super) observed: &'a Observed<'a>,
    /// One sample and chosen point in so many is matched.
    pub(super) thin: usize,
}

impl Matching<'_> {
    /// Matches of samples with the observation and, but for the paper's method, back. Samples that
    /// hardly moved keep theirs.
    pub(super) fn matches(&self, vertices: &[Point], reach: f64, pairs: &mut Pairs) -> Vec<Match> {
        let sampled = self.model.sampled(vertices, self.thin);
        let robust = self.method == Method::Robust;
        let unit = DEVIATION * self.model.height();
        let Observation { points, normals } = self.observed.observation;
        self.find(pairs, &sampled);
        let matched = |sample: usize, point: usize, count: usize| {
            let (normal, offset) =
                (DVec3::from(normals[point]), DVec3::from(sampled.points[sample]) - DVec3::from(points[point]));
            let cosine = normal.dot(sampled.normals[sample].into());
            let residual = normal.dot(offset);
            let weight = match robust {
                true if cosine < MIN_COSINE => 0.0,
                true => cosine / (1.0 + offset.length_squared() / (reach * reach)),
                false => 1.0,
            };
            let weight = weight / (count as f64 * unit * unit);
            Match { sample: sample * self.thin, normal, residual, distance: offset.length(), weight }
        };
        let count = pairs.forth.len();
        let forth = pairs.forth.iter().enumerate().map(|(s, &p)| matched(s, p, count));
        let chosen = self.observed.chosen.iter().step_by(self.thin);
        let back = chosen.zip(&pairs.back).map(|(&p, &s)| matched(s, p, pairs.back.len()));
        forth.chain(back).collect()
    }

    /// Brings pairs up to date.
    fn find(&self, pairs: &mut Pairs, sampled: &Observation) {
        let still2 = (KEPT * self.model.height()).powi(2);
        let Pairs { at, forth, back } = pairs;
        let count = sampled.points.len();
        let moved = |s: usize, at: &[Point]| {
            at.get(s).is_none_or(|&p| DVec3::from(p).distance_squared(sampled.points[s].into()) > still2)
        };
        let has_moved: Vec<bool> = (0..count).map(|s| moved(s, at)).collect();
        forth.resize(count, 0);
        at.resize(count, [0.0; 3]);
        forth
            .par_iter_mut()
            .zip(at.par_iter_mut())
            .with_min_len(TASK)
            .enumerate()
            .filter(|&(s, _)| has_moved[s])
            .for_each(|(s, (pair, at))| {
                *pair = self.observed.tree.nearest(sampled.points[s], sampled.normals[s]).0;
                *at = sampled.points[s];
            });
        let count_moved = has_moved.iter().filter(|&&moved| moved).count();
        if self.method == Method::Robust && (back.is_empty() || count_moved * 20 > count) {
            let tree = OrientedPoints::new(&sampled.points, &sampled.normals, NORMAL_LENGTH * self.model.diagonal());
            let Observation { points, normals } = self.observed.observation;
            let chosen: Vec<usize> = self.observed.chosen.iter().copied().step_by(self.thin).collect();
            *back = chosen.par_iter().with_min_len(TASK).map(|&p| tree.nearest(points[p], normals[p]).0).collect();
        }
    }

    /// How well the template lies under a cage with these vertices.
    pub(super) fn score(&self, vertices: &[Point]) -> Score {
        let height = self.model.height();
        let cap = SCORE_CAP * height;
        let mut pairs = Pairs::default();
        let matches = self.matches(vertices, cap, &mut pairs);
        let capped = |found: &Match| if found.weight > 0.0 { found.distance.min(cap) } else { cap };
        let mut parts = [(0.0, 0); QUADS];
        for found in &matches[..pairs.forth.len()] {
            let (sum, count) = &mut parts[self.model.part(found.sample)];
            *sum += capped(found) / height;
            *count += 1;
        }
        let mean = matches.iter().map(capped).sum::<f64>() / (matches.len() as f64 * height);
        Score { mean, parts: parts.map(|(sum, count)| sum / f64::from(count.max(1))) }
    }
}
