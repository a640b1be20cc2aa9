//! One frame: rounds of matching and Gauss–Newton, stage after stage.

use super::equations::NormalEquations;
use super::model::{CAGE_UNKNOWNS, PersonModel, Sampled};
use super::options::{FitOptions, Method};
use super::search::search;
use super::stages::{Free, LatentStage, QuadStage, Stage, VertexStage};
use crate::manifold::Manifold;
use crate::rig::{Placement, QUAD_UNKNOWNS, deform};
use cager_geometry::linalg::zeros;
use cager_geometry::mesh::Point;
use cager_registration::{Observation, OrientedPoints};
use glam::DVec3;
use rayon::prelude::*;

/// Length of a normal in matches, as a fraction of the template's diagonal.
const NORMAL_LENGTH: f64 = 0.02;
/// Distances beyond this fraction of the height count no more in scores.
const SCORE_CAP: f64 = 0.1;
/// Cosine of normals below which a match does not count.
const MIN_COSINE: f64 = 0.2;
/// A stage ends where its step moves no vertex by more than this fraction of the height.
const STILL: f64 = 1e-4;

/// What was fitted to a frame, and what the next one begins with.
#[derive(Clone, Debug)]
pub struct FrameFit {
    /// Where the pelvis is.
    pub placement: Placement,
    /// Latent numbers.
    pub latent: Vec<f64>,
    /// The pose of the quads.
    pub pose: Vec<f64>,
    /// Vertices of the cage.
    pub vertices: Vec<Point>,
    /// Mean distance of matches, both ways, none beyond a tenth of the height, as a fraction of it.
    pub score: f64,
    /// Vertices of the cage of the manifold alone, and of the quads: what the stages before the last came to.
    pub stages: [Vec<Point>; 2],
}

/// A template, its rig and a manifold, ready to be fitted.
pub struct PersonFit<'a> {
    /// The template.
    pub model: &'a PersonModel,
    /// The manifold.
    pub manifold: &'a Manifold,
    /// How it is fitted.
    pub options: FitOptions,
}

/// An observation, ready to be matched.
pub(super) struct Observed<'a> {
    pub(super) observation: &'a Observation,
    pub(super) tree: OrientedPoints,
    /// Those of its points that are matched with the template.
    pub(super) chosen: Vec<usize>,
}

/// A point of the template at the plane of an observed one.
struct Match {
    sample: usize,
    normal: DVec3,
    residual: f64,
    distance: f64,
    weight: f64,
}

impl<'a> PersonFit<'a> {
    /// Fits a frame, beginning with the fit of a frame before it or after it, or else with a search.
    pub fn fit(&self, observation: &Observation, start: Option<&FrameFit>) -> FrameFit {
        let observed = self.observed(observation);
        let options = &self.options;
        let rounds = if start.is_some() { options.rounds } else { options.first_rounds };
        let (placement, latent) = match start {
            Some(fit) => (fit.placement, fit.latent.clone()),
            None => search(self, &observed),
        };
        let carried = start.map(|fit| {
            let on_manifold = self.manifold.pose(&fit.latent);
            fit.pose.iter().zip(&on_manifold).map(|(y, m)| (y - m) * options.carried).collect::<Vec<f64>>()
        });
        self.finish(&observed, self.latent_stage(placement, latent), rounds, carried.as_deref())
    }

    /// All stages from a placement and latent numbers.
    fn finish(
        &self,
        observed: &Observed<'_>,
        mut stage: LatentStage<'_>,
        rounds: [usize; 3],
        carried: Option<&[f64]>,
    ) -> FrameFit {
        let (options, rig, height) = (&self.options, self.model.rig(), self.model.height());
        if options.method == Method::Paper {
            for free in [Free::Placement, Free::Latent, Free::Placement, Free::Latent, Free::Placement, Free::Latent] {
                stage.free = free;
                self.run(&mut stage, observed, rounds[0]);
            }
        } else {
            self.run(&mut stage, observed, rounds[0]);
        }
        let (placement, latent) = (stage.placement, stage.latent);
        let target = self.manifold.pose(&latent);
        let on_manifold = deform(rig, &target, &placement).vertices;
        let start = match carried {
            Some(carried) if options.method == Method::Robust => {
                target.iter().zip(carried).map(|(a, b)| a + b).collect()
            }
            _ => target.clone(),
        };
        let mut quads = QuadStage::new(rig, height, options, placement, [start, target]);
        self.run(&mut quads, observed, rounds[1]);
        let of_quads = quads.linearized().vertices;
        let vertices = if options.method == Method::Robust {
            let mut vertices = VertexStage::new(height, options, of_quads.clone());
            self.run(&mut vertices, observed, rounds[2]);
            vertices.linearized().vertices
        } else {
            of_quads.clone()
        };
        let score = self.score(observed, &vertices);
        FrameFit {
            placement: quads.placement,
            latent,
            pose: quads.pose,
            vertices,
            score,
            stages: [on_manifold, of_quads],
        }
    }

    /// The stage of placement and latent numbers.
    pub(super) fn latent_stage(&self, placement: Placement, latent: Vec<f64>) -> LatentStage<'a> {
        LatentStage {
            rig: self.model.rig(),
            manifold: self.manifold,
            placement,
            latent,
            weight: self.options.prior,
            free: Free::Both,
        }
    }

    pub(super) fn observed<'o>(&self, observation: &'o Observation) -> Observed<'o> {
        let length = match self.options.method {
            Method::Robust => NORMAL_LENGTH * self.model.diagonal(),
            Method::Paper => 0.0,
        };
        let tree = OrientedPoints::new(&observation.points, &observation.normals, length);
        let (all, wanted) = (observation.points.len(), self.options.observed.max(1));
        let chosen = (0..wanted.min(all)).map(|k| k * all / wanted.min(all)).collect();
        Observed { observation, tree, chosen }
    }

    /// Rounds of Gauss–Newton.
    pub(super) fn run(&self, stage: &mut dyn Stage, observed: &Observed<'_>, rounds: usize) {
        let mut last: Option<Vec<Point>> = None;
        for round in 0..rounds {
            let at = stage.linearized();
            let far = last.map(|last| farthest(&last, &at.vertices));
            if far.is_some_and(|far| far < STILL * self.model.height()) {
                break;
            }
            let share = round as f64 / (rounds.max(2) - 1) as f64;
            let [first, end] = self.options.reach;
            let reach = first * (end / first).powf(share) * self.options.deviation * self.model.height();
            let matches = self.matches(observed, &at.vertices, reach);
            let derivative = self.model.derivative(&at.vertices);
            let mut rows = zeros(stage.unknowns(), matches.len());
            rows.as_mut().par_col_chunks_mut(64).enumerate().for_each(|(chunk, mut columns)| {
                let mut row = vec![0.0; CAGE_UNKNOWNS];
                let mut scratch = vec![0.0; 6 + QUAD_UNKNOWNS];
                let mut out = vec![0.0; columns.nrows()];
                for k in 0..columns.ncols() {
                    let found = &matches[chunk * 64 + k];
                    derivative.row(found.sample, found.normal * found.weight.sqrt(), &mut row);
                    at.pull(&row, &mut scratch, &mut out);
                    columns.as_mut().col_mut(k).iter_mut().zip(&out).for_each(|(to, from)| *to = *from);
                }
            });
            let residuals: Vec<f64> = matches.iter().map(|m| m.residual * m.weight.sqrt()).collect();
            let mut equations = NormalEquations::new(&rows, &residuals);
            stage.hold(&mut equations);
            let Some(step) = equations.step() else { break };
            stage.step(&step);
            last = Some(at.vertices);
        }
    }

    /// Matches of the samples with the observation and, but for the paper's method, back.
    fn matches(&self, observed: &Observed<'_>, vertices: &[Point], reach: f64) -> Vec<Match> {
        let sampled = self.model.sampled(vertices);
        let robust = self.options.method == Method::Robust;
        let unit = self.options.deviation * self.model.height();
        let Observation { points, normals } = observed.observation;
        let matched = |sample: usize, point: usize, count: usize| {
            let (normal, offset) =
                (DVec3::from(normals[point]), DVec3::from(sampled.points[sample]) - DVec3::from(points[point]));
            let cosine = normal.dot(sampled.normals[sample].into());
            let weight = match robust {
                true if cosine < MIN_COSINE => 0.0,
                true => cosine / (1.0 + offset.length_squared() / (reach * reach)),
                false => 1.0,
            };
            let weight = weight / (count as f64 * unit * unit);
            Match { sample, normal, residual: normal.dot(offset), distance: offset.length(), weight }
        };
        let forth: Vec<usize> = (0..sampled.points.len())
            .into_par_iter()
            .map(|s| observed.tree.nearest(sampled.points[s], sampled.normals[s]).0)
            .collect();
        let mut all: Vec<Match> = forth.iter().enumerate().map(|(s, &p)| matched(s, p, forth.len())).collect();
        if robust {
            let back = self.nearest_samples(observed, &sampled);
            all.extend(observed.chosen.iter().zip(&back).map(|(&p, &s)| matched(s, p, back.len())));
        }
        all
    }

    fn nearest_samples(&self, observed: &Observed<'_>, sampled: &Sampled) -> Vec<usize> {
        let tree = OrientedPoints::new(&sampled.points, &sampled.normals, NORMAL_LENGTH * self.model.diagonal());
        let Observation { points, normals } = observed.observation;
        observed.chosen.par_iter().map(|&p| tree.nearest(points[p], normals[p]).0).collect()
    }

    /// See [`FrameFit::score`].
    pub(super) fn score(&self, observed: &Observed<'_>, vertices: &[Point]) -> f64 {
        let cap = SCORE_CAP * self.model.height();
        let matches = self.matches(observed, vertices, cap);
        let capped = |found: &Match| if found.weight > 0.0 { found.distance.min(cap) } else { cap };
        matches.iter().map(capped).sum::<f64>() / (matches.len() as f64 * self.model.height())
    }
}

fn farthest(a: &[Point], b: &[Point]) -> f64 {
    a.iter().zip(b).map(|(p, q)| DVec3::from(*p).distance((*q).into())).fold(0.0, f64::max)
}
