//! One frame: rounds of matching and Gauss–Newton, stage after stage.

use super::equations::NormalEquations;
use super::limbs::{limb_scores, pose_with_other_limbs};
use super::matching::{Match, Matching, NORMAL_LENGTH, Observed, Pairs};
use super::model::{CAGE_UNKNOWNS, PersonModel};
use super::options::{CARRIED, DEVIATION, FitOptions, Method, OBSERVED, PRIOR, REACH, ROUNDS};
use super::stages::{Free, LatentStage, Linearized, QuadStage, Stage, VertexStage};
use crate::Similarity;
use crate::people::manifold::Manifold;
use crate::people::rig::{QUAD_UNKNOWNS, QUADS};
use crate::registration::{Observation, OrientedPoints};
use cager_geometry::linalg::zeros;
use cager_geometry::mesh::Point;
use faer::Mat;
use glam::DVec3;
use rayon::prelude::*;

/// A stage ends where its step moves no vertex by more than this fraction of the height.
const STILL: f64 = 2e-4;
/// A limb with a mean distance above this share of the height, or this ratio to the frame before,
/// is tried elsewhere.
const RESEED_ABOVE: [f64; 2] = [0.015, 1.3];
/// More rounds for quads of limbs that were put elsewhere.
const EXTRA_ROUNDS: usize = 4;
/// Matches whose derivatives one task computes.
const TASK: usize = 64;

/// What was fitted to a frame, and what the next one begins with.
#[derive(Clone, Debug)]
pub struct FrameFit {
    /// Where the pelvis is.
    pub placement: Similarity,
    /// Latent numbers.
    pub latent: Vec<f64>,
    /// The pose of the quads.
    pub pose: Vec<f64>,
    /// Vertices of the cage.
    pub vertices: Vec<Point>,
    /// Mean distance of matches, both ways, none beyond a tenth of the height, as a fraction of it.
    pub score: f64,
    /// Of each quad, the mean distance of the template around it.
    pub parts: [f64; QUADS],
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

/// Rounds of Gauss–Newton.
#[derive(Clone, Copy)]
pub(super) struct Rounds {
    /// How many, at the most.
    pub(super) count: usize,
    /// One sample in so many is matched.
    pub(super) thin: usize,
    /// Distance at which a match counts half, in units, in the first and in the last.
    pub(super) reach: [f64; 2],
}

impl<'a> PersonFit<'a> {
    /// Fits a frame from the fit of one beside it, or else with a search.
    pub fn fit(&self, observation: &Observation, start: Option<&FrameFit>) -> FrameFit {
        let observed = self.observed(observation);
        if let Some(fit) = start {
            let mut stage = self.latent_stage(fit.placement, fit.latent.clone());
            stage.offset = self.offset(&stage, &fit.pose);
            let found = self.finish(&observed, stage, ROUNDS);
            let (before, now) = (limb_scores(&fit.parts), limb_scores(&found.parts));
            let misplaced = |&limb: &usize| now[limb] > RESEED_ABOVE[0].min(RESEED_ABOVE[1] * before[limb]);
            let limbs: Vec<usize> = (0..now.len()).filter(misplaced).collect();
            return self.refit_with_other_limbs(&observed, found, &limbs);
        }
        self.first_fit(&observed)
    }

    /// A fit with limbs put elsewhere, where it then lies better.
    pub(super) fn refit_with_other_limbs(&self, observed: &Observed<'_>, fit: FrameFit, limbs: &[usize]) -> FrameFit {
        if self.options.method == Method::Paper || limbs.is_empty() {
            return fit;
        }
        let other = pose_with_other_limbs((self.model, self.manifold), observed, (&fit.placement, &fit.pose), limbs);
        let Some(pose) = other else { return fit };
        let mut stage = self.latent_stage(fit.placement, fit.latent.clone());
        stage.offset = pose.iter().zip(stage.pose()).map(|(y, on)| y - on).collect();
        let [_, quads, vertices] = ROUNDS;
        let again = self.finish(observed, stage, [0, quads + EXTRA_ROUNDS, vertices]);
        if again.score < fit.score { again } else { fit }
    }

    /// The share of a pose's offset from the manifold that is carried on.
    pub(super) fn offset(&self, stage: &LatentStage<'_>, pose: &[f64]) -> Vec<f64> {
        if self.options.method == Method::Paper {
            return stage.offset.clone();
        }
        pose.iter().zip(stage.pose()).map(|(y, on)| (y - on) * CARRIED).collect()
    }

    /// All stages from a placement and latent numbers.
    pub(super) fn finish(&self, observed: &Observed<'_>, mut stage: LatentStage<'_>, rounds: [usize; 3]) -> FrameFit {
        let (options, rig, height) = (&self.options, self.model.rig(), self.model.height());
        if options.method == Method::Paper {
            for free in [Free::Placement, Free::Latent, Free::Placement, Free::Latent, Free::Placement, Free::Latent] {
                stage.free = free;
                self.run(&mut stage, observed, self.rounds(rounds[0]));
            }
        } else {
            self.run(&mut stage, observed, self.rounds(rounds[0]));
        }
        let target = stage.pose();
        let (placement, latent) = (stage.placement, stage.latent);
        let mut quads = QuadStage::new(rig, height, options, placement, target);
        self.run(&mut quads, observed, self.rounds(rounds[1]));
        let mut vertices = quads.linearized().vertices;
        if options.method == Method::Robust && rounds[2] > 0 {
            let mut stage = VertexStage::new(height, options, vertices);
            self.run(&mut stage, observed, self.rounds(rounds[2]));
            vertices = stage.linearized().vertices;
        }
        let score = self.matching(observed, 1).score(&vertices);
        let QuadStage { placement, pose, .. } = quads;
        FrameFit { placement, latent, pose, vertices, score: score.mean, parts: score.parts }
    }

    /// The stage of placement and latent numbers.
    pub(super) fn latent_stage(&self, placement: Similarity, latent: Vec<f64>) -> LatentStage<'a> {
        LatentStage {
            rig: self.model.rig(),
            manifold: self.manifold,
            placement,
            latent,
            offset: vec![0.0; QUAD_UNKNOWNS],
            weight: PRIOR,
            free: Free::Both,
        }
    }

    pub(super) fn observed<'o>(&self, observation: &'o Observation) -> Observed<'o> {
        let length = match self.options.method {
            Method::Robust => NORMAL_LENGTH * self.model.diagonal(),
            Method::Paper => 0.0,
        };
        let tree = OrientedPoints::new(&observation.points, &observation.normals, length);
        let (all, wanted) = (observation.points.len(), OBSERVED);
        let chosen = (0..wanted.min(all)).map(|k| k * all / wanted.min(all)).collect();
        Observed { observation, tree, chosen }
    }

    /// The template and an observation, one point in so many of both.
    pub(super) fn matching<'o>(&'o self, observed: &'o Observed<'o>, thin: usize) -> Matching<'o> {
        let thin = if self.options.method == Method::Robust { thin } else { 1 };
        Matching { model: self.model, method: self.options.method, observed, thin }
    }

    fn rounds(&self, count: usize) -> Rounds {
        Rounds { count, thin: 1, reach: REACH }
    }

    /// Rounds of Gauss–Newton.
    pub(super) fn run(&self, stage: &mut dyn Stage, observed: &Observed<'_>, rounds: Rounds) {
        let Rounds { count, thin, reach: [first, end] } = rounds;
        let matching = self.matching(observed, thin);
        let mut last: Option<Vec<Point>> = None;
        let mut pairs = Pairs::default();
        for round in 0..count {
            let at = stage.linearized();
            let far = last.map(|last| farthest(&last, &at.vertices));
            if far.is_some_and(|far| far < STILL * self.model.height()) {
                break;
            }
            let share = round as f64 / (count.max(2) - 1) as f64;
            let reach = first * (end / first).powf(share) * DEVIATION * self.model.height();
            let matches = matching.matches(&at.vertices, reach, &mut pairs);
            let derivatives = self.derivatives(&at, &matches);
            let residuals: Vec<f64> = matches.iter().map(|m| m.residual * m.weight.sqrt()).collect();
            let mut equations = NormalEquations::new(&derivatives, &residuals);
            stage.hold(&mut equations);
            let Some(step) = equations.step() else { break };
            stage.step(&step);
            last = Some(at.vertices);
        }
    }

    /// Derivatives of weighted residuals by the unknowns, one column for each match.
    pub(super) fn derivatives(&self, at: &Linearized, matches: &[Match]) -> Mat<f64> {
        let derivative = self.model.derivative(&at.vertices);
        let mut rows = zeros(at.width(), matches.len());
        rows.as_mut().par_col_chunks_mut(TASK).enumerate().for_each(|(chunk, mut columns)| {
            let mut row = vec![0.0; CAGE_UNKNOWNS];
            for (k, found) in matches[chunk * TASK..].iter().take(columns.ncols()).enumerate() {
                derivative.row(found.sample, found.normal * found.weight.sqrt(), &mut row);
                if let Some(column) = columns.as_mut().col_mut(k).try_as_col_major_mut() {
                    at.pull(&row, column.as_slice_mut());
                }
            }
        });
        at.through(rows)
    }
}

fn farthest(a: &[Point], b: &[Point]) -> f64 {
    a.iter().zip(b).map(|(p, q)| DVec3::from(*p).distance((*q).into())).fold(0.0, f64::max)
}
