//! One frame: rounds of matching and Gauss–Newton, stage after stage.

use super::equations::NormalEquations;
use super::model::{CAGE_UNKNOWNS, PersonModel, Sampled};
use super::observed::Observed;
use super::options::{FitOptions, Method};
use super::search::search;
use super::stages::{Free, LatentStage, Linearized, QuadStage, Stage, VertexStage};
use crate::manifold::Manifold;
use crate::rig::{Placement, QUAD_UNKNOWNS, deform};
use cager_geometry::linalg::zeros;
use cager_geometry::mesh::Point;
use cager_registration::{Observation, OrientedPoints};
use faer::Mat;
use glam::DVec3;
use rayon::prelude::*;

/// Length of a normal in matches, as a fraction of the template's diagonal.
const NORMAL_LENGTH: f64 = 0.02;
/// Distances beyond this fraction of the height count no more in scores.
const SCORE_CAP: f64 = 0.1;
/// Cosine of normals below which a match does not count.
const MIN_COSINE: f64 = 0.2;
/// A stage ends where its step moves no vertex by more than this fraction of the height.
const STILL: f64 = 2e-4;
/// A sample keeps its observed point while it moves by no more than this fraction of the height.
const KEPT: f64 = 3e-4;
/// Matches whose derivatives one task computes.
const TASK: usize = 64;

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

/// Which sample belongs to which observed point.
#[derive(Default)]
struct Pairs {
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

impl<'a> PersonFit<'a> {
    /// Fits a frame, beginning with the fit of a frame before it or after it, or else with a search.
    pub fn fit(&self, observation: &Observation, start: Option<&FrameFit>) -> FrameFit {
        let observed = self.observed(observation);
        if let Some(fit) = start {
            let mut stage = self.latent_stage(fit.placement, fit.latent.clone());
            stage.offset = self.offset(&stage, &fit.pose);
            return self.finish(&observed, stage, self.options.rounds);
        }
        let starts = search(self.model, self.manifold, self.options.candidates, &observed);
        let fits = starts.into_iter().map(|(placement, latent)| self.fit_from(&observed, placement, latent));
        // The examples of a manifold are never none, so there is a start.
        fits.reduce(|best, fit| if fit.score < best.score { fit } else { best }).unwrap_or_else(|| {
            self.finish(&observed, self.latent_stage(Placement::default(), vec![0.0; self.manifold.dims()]), [0; 3])
        })
    }

    /// Fits from a start of the search: once to find what the pose is off the manifold by, and once more from there.
    fn fit_from(&self, observed: &Observed<'_>, placement: Placement, latent: Vec<f64>) -> FrameFit {
        let options = &self.options;
        let stage = self.latent_stage(placement, latent);
        if options.method == Method::Paper {
            return self.finish(observed, stage, options.first_rounds);
        }
        let [latents, quads, vertices] = options.first_rounds;
        let first = self.finish(observed, stage, [latents, quads, 0]);
        let mut stage = self.latent_stage(first.placement, first.latent.clone());
        stage.offset = self.offset(&stage, &first.pose);
        self.finish(observed, stage, [quads, quads, vertices])
    }

    /// The share of a pose's offset from the manifold that is carried on.
    fn offset(&self, stage: &LatentStage<'_>, pose: &[f64]) -> Vec<f64> {
        if self.options.method == Method::Paper {
            return stage.offset.clone();
        }
        pose.iter().zip(stage.pose()).map(|(y, on)| (y - on) * self.options.carried).collect()
    }

    /// All stages from a placement and latent numbers.
    fn finish(&self, observed: &Observed<'_>, mut stage: LatentStage<'_>, rounds: [usize; 3]) -> FrameFit {
        let (options, rig, height) = (&self.options, self.model.rig(), self.model.height());
        if options.method == Method::Paper {
            for free in [Free::Placement, Free::Latent, Free::Placement, Free::Latent, Free::Placement, Free::Latent] {
                stage.free = free;
                self.run(&mut stage, observed, rounds[0]);
            }
        } else {
            self.run(&mut stage, observed, rounds[0]);
        }
        let target = stage.pose();
        let (placement, latent) = (stage.placement, stage.latent);
        let on_manifold = deform(rig, &target, &placement).vertices;
        let start = target.clone();
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
            offset: vec![0.0; QUAD_UNKNOWNS],
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
        let mut pairs = Pairs::default();
        for round in 0..rounds {
            let at = stage.linearized();
            let far = last.map(|last| farthest(&last, &at.vertices));
            if far.is_some_and(|far| far < STILL * self.model.height()) {
                break;
            }
            let share = round as f64 / (rounds.max(2) - 1) as f64;
            let [first, end] = self.options.reach;
            let reach = first * (end / first).powf(share) * self.options.deviation * self.model.height();
            let matches = self.matches(observed, &at.vertices, reach, &mut pairs);
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

    /// Matches of the samples with the observation and, but for the paper's method, back. Samples that hardly moved since `pairs` were found keep theirs.
    fn matches(&self, observed: &Observed<'_>, vertices: &[Point], reach: f64, pairs: &mut Pairs) -> Vec<Match> {
        let sampled = self.model.sampled(vertices);
        let robust = self.options.method == Method::Robust;
        let unit = self.options.deviation * self.model.height();
        let Observation { points, normals } = observed.observation;
        self.find(pairs, observed, &sampled);
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
        let count = pairs.forth.len();
        let forth = pairs.forth.iter().enumerate().map(|(s, &p)| matched(s, p, count));
        let back = observed.chosen.iter().zip(&pairs.back).map(|(&p, &s)| matched(s, p, pairs.back.len()));
        forth.chain(back).collect()
    }

    /// Brings pairs up to date.
    fn find(&self, pairs: &mut Pairs, observed: &Observed<'_>, sampled: &Sampled) {
        let still2 = (KEPT * self.model.height()).powi(2);
        let Pairs { at, forth, back } = pairs;
        let count = sampled.points.len();
        let moved = |s: usize, at: &[Point]| {
            at.get(s).is_none_or(|&p| DVec3::from(p).distance_squared(sampled.points[s].into()) > still2)
        };
        let anew: Vec<bool> = (0..count).map(|s| moved(s, at)).collect();
        forth.resize(count, 0);
        at.resize(count, [0.0; 3]);
        forth.par_iter_mut().zip(at.par_iter_mut()).enumerate().filter(|&(s, _)| anew[s]).for_each(
            |(s, (pair, at))| {
                *pair = observed.tree.nearest(sampled.points[s], sampled.normals[s]).0;
                *at = sampled.points[s];
            },
        );
        let some = anew.iter().filter(|&&anew| anew).count();
        if self.options.method == Method::Robust && (back.is_empty() || some * 20 > count) {
            let tree = OrientedPoints::new(&sampled.points, &sampled.normals, NORMAL_LENGTH * self.model.diagonal());
            let Observation { points, normals } = observed.observation;
            *back = observed.chosen.par_iter().map(|&p| tree.nearest(points[p], normals[p]).0).collect();
        }
    }

    /// See [`FrameFit::score`].
    pub(super) fn score(&self, observed: &Observed<'_>, vertices: &[Point]) -> f64 {
        let cap = SCORE_CAP * self.model.height();
        let matches = self.matches(observed, vertices, cap, &mut Pairs::default());
        let capped = |found: &Match| if found.weight > 0.0 { found.distance.min(cap) } else { cap };
        matches.iter().map(capped).sum::<f64>() / (matches.len() as f64 * self.model.height())
    }
}

fn farthest(a: &[Point], b: &[Point]) -> f64 {
    a.iter().zip(b).map(|(p, q)| DVec3::from(*p).distance((*q).into())).fold(0.0, f64::max)
}
