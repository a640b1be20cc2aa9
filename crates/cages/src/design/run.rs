//! The optimisation loop of a design: steps, remeshing, evaluation, and the best cage so far.

use super::contact::Obstacles;
use super::descent::Descent;
use super::options::{Design, DesignOptions, Goal, Progress, Stage, Style, Unseen};
use super::parts::Parts;
use super::samples::{Evaluation, Samples};
use cager_core::cage::Cage;
use cager_geometry::mesh::{Model, Point, TriMesh};
use cager_geometry::spatial::{outside, self_intersections};
use std::f64::consts::PI;
use std::ops::ControlFlow;
use std::time::Instant;

/// Steps of a design with a given number of vertices.
const STEPS: usize = 140;
/// Step lengths fall along a cosine over so many times the steps of a phase; from this share on,
/// linearly to zero as well: slow steps to the end bring little, a shorter cosine leaves larger
/// errors.
const COSINE_STEPS: f64 = 1.36;
const FADE_FROM: f64 = 0.75;
/// Vertices are exchanged after so many steps, up to this share at a time, until this share of the
/// steps.
const REMESH_EVERY: usize = 12;
const REMESH_SHARE: f64 = 0.1;
const REMESH_UNTIL: f64 = 0.75;
/// Steps before the first evaluation of the cage, and between later ones.
const FIRST_EVALUATION: usize = 10;
const EVALUATE_EVERY: usize = 60;

/// Errors above this share of the diagonal suggest frames that tear the rest pose.
const NOT_FOLLOWED: f64 = 0.03;

/// The best cage so far.
#[derive(Clone)]
pub(super) struct Best {
    pub(super) mesh: TriMesh,
    pub(super) evaluation: Evaluation,
}

/// Defects that an editable cage should not have.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Defects {
    /// Points of the model, ascending.
    pub(super) outside: Vec<u32>,
    cuts: usize,
}

impl Defects {
    pub(super) fn of(mesh: &TriMesh, points: &[Point]) -> Self {
        let outside = outside(mesh, points).into_iter().map(|(point, _)| point).collect();
        Self { outside, cuts: self_intersections(mesh).len() }
    }
}

/// A running design.
pub(super) struct Run<'a> {
    pub(super) rest: &'a Model,
    /// What the design was given, and what each is for.
    pub(super) frames: (&'a [Vec<f64>], &'a Parts),
    pub(super) samples: &'a Samples,
    pub(super) options: &'a DesignOptions,
    pub(super) clock: Instant,
    pub(super) watch: &'a mut dyn FnMut(Progress<'_>) -> ControlFlow<()>,
    pub(super) best: Best,
    /// The last cage that was kept, or the initial one.
    pub(super) valid: TriMesh,
    /// Defects of the initial cage; later ones must not have more.
    pub(super) defects: Defects,
    pub(super) stages: Vec<Stage>,
    /// Whether the error that was asked for is not met.
    pub(super) missed: bool,
}

/// A sequence of steps with a target number of vertices.
pub(super) struct Phase {
    pub(super) stage: &'static str,
    pub(super) steps: usize,
    pub(super) goal: usize,
    /// The interval of the overall progress that it covers.
    pub(super) fraction: [f64; 2],
}

impl Run<'_> {
    pub(super) fn optimise(mut self, cage: Cage, obstacles: Obstacles) -> Design {
        let mut descent = Descent::new(cage, self.samples, obstacles, self.options);
        let mut warnings = Vec::new();
        let evaluation = self.best.evaluation.clone();
        let begun = Progress {
            stage: "moving the vertices",
            fraction: 0.0,
            error: Some(evaluation.validation_error),
            better: Some(descent.cage.mesh()),
        };
        // The first usable cage does not wait for its condition number.
        let told = (self.watch)(begun);
        self.note("start", &descent.cage, &evaluation);
        let ended = match told {
            ControlFlow::Break(()) => ControlFlow::Break(()),
            ControlFlow::Continue(()) => self.descend(&mut descent, &mut warnings),
        };
        if self.options.style == Style::Editable && !self.defects.outside.is_empty() {
            warnings.push(format!(
                "{} points lie outside the cage that the design began with, and stayed there; repair it first to have all inside",
                self.defects.outside.len()
            ));
        }
        if self.best.evaluation.validation_error > NOT_FOLLOWED {
            warnings.push(format!(
                "even the best cage found leaves an error of {:.1} % of the diagonal: the frames tear the model apart, have points far from their places, or are not of this rest pose",
                100.0 * self.best.evaluation.validation_error
            ));
        }
        let timed_out = ended.is_break() && self.is_late();
        let Best { mesh, evaluation } = self.best.clone();
        let mut unseen = None;
        if let Ok(cage) = Cage::new(mesh.clone()) {
            self.note("the best", &cage, &evaluation);
            let error = self.samples.unseen_error(&cage);
            unseen = error.map(|error| Unseen { error, stretches: self.frames.1.unseen.clone() });
        }
        Design {
            cage: mesh,
            carriers: Vec::new(),
            stages: self.stages,
            unseen,
            timed_out,
            missed: self.missed,
            warnings,
        }
    }

    fn descend(&mut self, descent: &mut Descent<'_>, warnings: &mut Vec<String>) -> ControlFlow<()> {
        let goal = match self.options.goal {
            _ if self.keeps_connectivity() => descent.cage.vertices().len(),
            Goal::Vertices(goal) => goal,
            Goal::MeanError(error) => return self.search(descent, error, warnings),
        };
        self.phase(descent, &Phase { stage: "moving the vertices", steps: STEPS, goal, fraction: [0.0, 1.0] })
    }

    /// Runs a sequence of steps; ends early on request of `watch` or by the time limit.
    pub(super) fn phase(&mut self, descent: &mut Descent<'_>, phase: &Phase) -> ControlFlow<()> {
        let share = if self.keeps_connectivity() { 0.0 } else { REMESH_SHARE };
        let exchanges = (REMESH_UNTIL * phase.steps as f64) as usize;
        for step in 0..phase.steps {
            if share > 0.0 && step % REMESH_EVERY == 0 && step <= exchanges {
                descent.exchange(share, phase.goal);
            }
            descent.step(step_scale(step as f64 / phase.steps as f64));
            let done = step + 1;
            let mut is_better = false;
            if done == FIRST_EVALUATION || done % EVALUATE_EVERY == 0 || done == phase.steps {
                let evaluation = self.samples.evaluate(&descent.cage);
                if done % EVALUATE_EVERY == 0 {
                    self.note(&format!("{done} steps"), &descent.cage, &evaluation);
                }
                // A smaller cage than asked for may do; a larger one may not.
                is_better = descent.cage.vertices().len() <= phase.goal && self.keep(descent, evaluation);
            }
            let fraction =
                phase.fraction[0] + (phase.fraction[1] - phase.fraction[0]) * done as f64 / phase.steps as f64;
            let late = self.is_late();
            if late && !is_better && descent.cage.vertices().len() <= phase.goal {
                // Include the progress since the last evaluation.
                let evaluation = self.samples.evaluate(&descent.cage);
                self.keep(descent, evaluation);
            }
            let error = Some(self.best.evaluation.validation_error).filter(|error| error.is_finite());
            let better = is_better.then_some(&self.best.mesh);
            (self.watch)(Progress { stage: phase.stage, fraction, error, better })?;
            if late {
                return ControlFlow::Break(());
            }
        }
        ControlFlow::Continue(())
    }

    /// Symmetry relates given vertices, so that it fixes the connectivity as well.
    fn keeps_connectivity(&self) -> bool {
        self.options.keep_connectivity || self.options.symmetry.is_some()
    }

    pub(super) fn is_late(&self) -> bool {
        self.options.time_limit.is_some_and(|limit| self.clock.elapsed() >= limit)
    }

    /// Keeps a cage that is better than the best so far and, if to be edited, valid. Points that
    /// obstacles stand for may be outside; they become obstacles then, and the last valid cage is
    /// moved on.
    fn keep(&mut self, descent: &mut Descent<'_>, evaluation: Evaluation) -> bool {
        if evaluation.validation_error.total_cmp(&self.best.evaluation.validation_error).is_ge() {
            return false;
        }
        let mesh = descent.cage.mesh().clone();
        if let Err(outside) = self.validated(&mesh) {
            if !outside.is_empty() {
                descent.go_back(&self.valid, outside.iter().map(|&point| self.rest.points[point as usize]));
            }
            return false;
        }
        self.valid = mesh.clone();
        self.best = Best { mesh, evaluation };
        true
    }

    /// Whether a cage to be edited has no new defects; otherwise the points that are outside.
    pub(super) fn validated(&self, mesh: &TriMesh) -> Result<(), Vec<u32>> {
        if self.options.style == Style::Free {
            return Ok(());
        }
        let Defects { mut outside, cuts } = Defects::of(mesh, &self.rest.points);
        outside.retain(|point| self.defects.outside.binary_search(point).is_err());
        if outside.is_empty() && cuts <= self.defects.cuts { Ok(()) } else { Err(outside) }
    }

    fn note(&mut self, name: &str, cage: &Cage, evaluation: &Evaluation) {
        self.stages.push(Stage {
            name: name.to_owned(),
            vertices: cage.vertices().len(),
            training_error: evaluation.training_error,
            validation_error: evaluation.validation_error,
            condition_number: evaluation.condition_number(),
            seconds: self.clock.elapsed().as_secs_f64(),
        });
    }
}

/// Length of a step over that of the longest, when a share of a phase's steps is done.
fn step_scale(done: f64) -> f64 {
    let fade = ((1.0 - done) / (1.0 - FADE_FROM)).min(1.0);
    0.5 * fade * (1.0 + (PI * done / COSINE_STEPS).cos()) + 0.02
}
