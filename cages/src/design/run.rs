//! A design from its first cage to its last: steps, exchanges, what is judged and kept.

use super::contact::Obstacles;
use super::descent::Descent;
use super::samples::{Judged, Samples};
use super::{Design, DesignOptions, Goal, Progress, Stage, Style};
use crate::geometry::{outside, self_intersections};
use cager_core::cage::Cage;
use cager_core::mesh::{Model, Point, TriMesh};
use std::f64::consts::PI;
use std::ops::ControlFlow;
use std::time::Instant;

/// Steps of a design with a given number of vertices.
const STEPS: usize = 190;
/// Vertices are exchanged after so many steps each, up to this share of them at a time, until this share of the steps is done.
const EXCHANGE_EVERY: usize = 10;
const EXCHANGED: f64 = 0.08;
const EXCHANGE_UNTIL: f64 = 0.7;
/// The cage is judged after so many steps each, and what was gained is noted this often.
const JUDGE_EVERY: usize = 30;
const NOTE_EVERY: usize = 60;

/// An error, as a fraction of the diagonal, that no cage of a model that holds together leaves.
const NOT_FOLLOWED: f64 = 0.03;

/// The best cage so far.
#[derive(Clone)]
pub(super) struct Best {
    pub(super) mesh: TriMesh,
    pub(super) judged: Judged,
}

/// What a cage for editing should not have.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Faults {
    outside: usize,
    cuts: usize,
}

impl Faults {
    pub(super) fn of(mesh: &TriMesh, points: &[Point]) -> Self {
        Self { outside: outside(mesh, points).len(), cuts: self_intersections(mesh).len() }
    }
}

/// A design on its way.
pub(super) struct Run<'a> {
    pub(super) rest: &'a Model,
    pub(super) samples: &'a Samples,
    pub(super) obstacles: &'a Obstacles,
    pub(super) options: &'a DesignOptions,
    pub(super) clock: Instant,
    pub(super) watch: &'a mut dyn FnMut(Progress<'_>) -> ControlFlow<()>,
    pub(super) best: Best,
    /// What the first cage had wrong; a later one has no more of it.
    pub(super) faults: Faults,
    pub(super) stages: Vec<Stage>,
}

/// Some steps with a number of vertices in view.
pub(super) struct Leg {
    pub(super) stage: &'static str,
    pub(super) steps: usize,
    pub(super) goal: usize,
    /// Part of the whole design that it is, from and to.
    pub(super) fraction: [f64; 2],
}

impl Run<'_> {
    pub(super) fn go(mut self, cage: Cage, frames: &[Vec<f64>]) -> Design {
        let mut descent = Descent::new(cage, self.samples, self.obstacles, self.options);
        let mut warnings = Vec::new();
        let judged = self.best.judged;
        self.note("start", &descent.cage, judged);
        let begun = Progress {
            stage: "moving the vertices",
            fraction: 0.0,
            error: Some(judged.held_back),
            better: Some(descent.cage.mesh()),
        };
        let ended = match (self.watch)(begun) {
            ControlFlow::Break(()) => ControlFlow::Break(()),
            ControlFlow::Continue(()) => self.descend(&mut descent, frames, &mut warnings),
        };
        if self.options.style == Style::Editable && self.faults.outside > 0 {
            warnings.push(format!(
                "{} points lie outside the cage that the design began with, and stayed there; repair it first to have all inside",
                self.faults.outside
            ));
        }
        if self.best.judged.held_back > NOT_FOLLOWED {
            warnings.push(format!(
                "even the best cage found leaves an error of {:.1} % of the diagonal: the frames tear the model apart, or are not of this rest pose",
                100.0 * self.best.judged.held_back
            ));
        }
        let timed_out = ended.is_break() && self.is_late();
        let Best { mesh, judged } = self.best;
        if let Ok(cage) = Cage::new(mesh.clone()) {
            self.stages.push(stage("the best", &cage, judged, self.samples, self.clock));
        }
        Design { cage: mesh, stages: self.stages, timed_out, warnings }
    }

    fn descend(
        &mut self,
        descent: &mut Descent<'_>,
        frames: &[Vec<f64>],
        warnings: &mut Vec<String>,
    ) -> ControlFlow<()> {
        let goal = match self.options.goal {
            _ if self.keeps_connectivity() => descent.cage.vertices().len(),
            Goal::Vertices(goal) => goal,
            Goal::MeanError(error) => return self.search(descent, frames, error, warnings),
        };
        self.leg(descent, &Leg { stage: "moving the vertices", steps: STEPS, goal, fraction: [0.0, 1.0] })
    }

    /// Takes the steps of a leg; breaks off where the watcher or the time limit says so.
    pub(super) fn leg(&mut self, descent: &mut Descent<'_>, leg: &Leg) -> ControlFlow<()> {
        let share = if self.keeps_connectivity() { 0.0 } else { EXCHANGED };
        let exchanges = (EXCHANGE_UNTIL * leg.steps as f64) as usize;
        for step in 0..leg.steps {
            if share > 0.0 && step % EXCHANGE_EVERY == 0 && step <= exchanges {
                descent.exchange(share, leg.goal);
            }
            descent.step(0.5 * (1.0 + (PI * step as f64 / leg.steps as f64).cos()) + 0.02);
            let done = step + 1;
            let mut better = None;
            if done % JUDGE_EVERY == 0 || done == leg.steps {
                let judged = self.samples.judge(&descent.cage);
                // A smaller cage than asked for may do; a larger one may not.
                if descent.cage.vertices().len() <= leg.goal && self.keep(&descent.cage, judged) {
                    better = Some(descent.cage.mesh());
                }
                if done % NOTE_EVERY == 0 {
                    self.note(&format!("{done} steps"), &descent.cage, judged);
                }
            }
            let fraction = leg.fraction[0] + (leg.fraction[1] - leg.fraction[0]) * done as f64 / leg.steps as f64;
            let late = self.is_late();
            if late && better.is_none() && descent.cage.vertices().len() <= leg.goal {
                // What was gained since the last look counts too.
                let judged = self.samples.judge(&descent.cage);
                self.keep(&descent.cage, judged);
            }
            let error = Some(self.best.judged.held_back).filter(|error| error.is_finite());
            (self.watch)(Progress { stage: leg.stage, fraction, error, better })?;
            if late {
                return ControlFlow::Break(());
            }
        }
        ControlFlow::Continue(())
    }

    /// A symmetry is one of the vertices that are there.
    fn keeps_connectivity(&self) -> bool {
        self.options.keep_connectivity || self.options.symmetry.is_some()
    }

    pub(super) fn is_late(&self) -> bool {
        self.options.time_limit.is_some_and(|limit| self.clock.elapsed() >= limit)
    }

    /// Keeps a cage that is better than the best so far.
    fn keep(&mut self, cage: &Cage, judged: Judged) -> bool {
        let better = judged.held_back < self.best.judged.held_back && self.is_sound(cage);
        if better {
            self.best = Best { mesh: cage.mesh().clone(), judged };
        }
        better
    }

    /// Whether a cage for editing is as valid as the first. Moves and exchanges keep it so; this is the proof.
    fn is_sound(&self, cage: &Cage) -> bool {
        self.options.style == Style::Free || {
            let Faults { outside, cuts } = Faults::of(cage.mesh(), &self.rest.points);
            outside <= self.faults.outside && cuts <= self.faults.cuts
        }
    }

    fn note(&mut self, name: &str, cage: &Cage, judged: Judged) {
        self.stages.push(stage(name, cage, judged, self.samples, self.clock));
    }
}

fn stage(name: &str, cage: &Cage, judged: Judged, samples: &Samples, clock: Instant) -> Stage {
    Stage {
        name: name.to_owned(),
        vertices: cage.vertices().len(),
        designed: judged.designed,
        held_back: judged.held_back,
        condition_number: samples.condition_number(cage),
        seconds: clock.elapsed().as_secs_f64(),
    }
}
