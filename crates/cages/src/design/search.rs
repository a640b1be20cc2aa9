//! Search for the smallest cage within an error bound, by how the error falls with the vertices.

use super::descent::Descent;
use super::options::{MAX_VERTICES, Progress};
use super::run::{Best, Phase, Run};
use super::samples::{Evaluation, evenly};
use crate::enclose::{EncloseError, EncloseOptions, enclose_watched};
use cager_core::cage::Cage;
use cager_core::coordinates::MeanValue;
use cager_core::inversion::{BATCH, Rows, Solver, SolverOptions};
use std::ops::ControlFlow;

const STAGE: &str = "searching the smallest cage";
/// Vertices to begin with.
const FIRST_VERTICES: usize = 100;
/// Steps with each number of vertices.
const STEPS: usize = 80;
/// How many numbers of vertices are tried.
const MAX_ROUNDS: usize = 8;
/// A cage whose error is at least this fraction of the goal is small enough.
const MIN_SHARE_OF_GOAL: f64 = 0.93;
/// What is aimed at next, as a fraction of the goal.
const AIM: f64 = 0.97;
/// Frames that the encoder's error is measured on.
const MAX_MEASURED_FRAMES: usize = 24;

/// Vertices to begin with around so many points.
pub(super) fn first_vertices(points: usize) -> usize {
    FIRST_VERTICES.min(points / 2).max(4)
}

impl Run<'_> {
    /// Grows or shrinks the cage until its error, as the encoder would leave it on the choosing
    /// frames, is at most `error` and not much less.
    pub(super) fn search(
        &mut self,
        descent: &mut Descent<'_>,
        error: f64,
        warnings: &mut Vec<String>,
    ) -> ControlFlow<()> {
        let mut goal = descent.cage.vertices().len();
        let most = MAX_VERTICES.min(self.rest.points.len() / 2).max(goal);
        let mut smallest: Option<Best> = None;
        let mut lowest: Option<(f64, Best)> = None;
        let mut ended = ControlFlow::Continue(());
        for round in 0..MAX_ROUNDS {
            let fraction = [round as f64 / MAX_ROUNDS as f64, (round + 1) as f64 / MAX_ROUNDS as f64];
            // Results with another number of vertices do not count.
            self.best = Best { mesh: descent.cage.mesh().clone(), evaluation: Evaluation::worst() };
            ended = self.phase(descent, &Phase { stage: STAGE, steps: STEPS, goal, fraction });
            if !self.best.evaluation.validation_error.is_finite() {
                let mesh = descent.cage.mesh();
                let mesh = if self.validated(mesh).is_ok() { mesh.clone() } else { self.valid.clone() };
                let evaluation =
                    Cage::new(mesh.clone()).map_or_else(|_| Evaluation::worst(), |cage| self.samples.evaluate(&cage));
                self.best = Best { mesh, evaluation };
            }
            let best = self.best.clone();
            let found = self.encoded_error(&best);
            if lowest.as_ref().is_none_or(|(least, _)| found < *least) {
                lowest = Some((found, best.clone()));
            }
            let count = best.mesh.vertices.len();
            let is_smaller = smallest.as_ref().is_none_or(|other| count < other.mesh.vertices.len());
            if found <= error && is_smaller {
                smallest = Some(best);
            }
            if ended.is_break() || (found <= error && found >= MIN_SHARE_OF_GOAL * error) {
                break;
            }
            if count > goal && found <= error {
                // No more vertices can be merged with all points inside; a cage made with fewer
                // lies farther out.
                let options = EncloseOptions { vertices: goal, ..EncloseOptions::default() };
                let rest = self.rest;
                let mut watch = || {
                    let now = Progress { stage: STAGE, fraction: fraction[1], error: Some(found), better: None };
                    if self.is_late() { ControlFlow::Break(()) } else { (self.watch)(now) }
                };
                match enclose_watched(rest, &options, &mut watch) {
                    Ok(mesh) if mesh.vertices.len() < count => descent.go_back(&mesh, std::iter::empty()),
                    Err(EncloseError::Stopped) => {
                        ended = ControlFlow::Break(());
                        break;
                    }
                    _ => break,
                }
                continue;
            }
            // The error falls about as the number of vertices rises.
            let aimed = (goal as f64 * (found / (AIM * error))).ceil() as usize;
            let next = aimed.clamp(goal / 2, goal * 2).clamp(4, most);
            if next == goal {
                break;
            }
            goal = next;
        }
        match smallest {
            Some(best) => self.best = best,
            None => {
                let Some((least, best)) = lowest else { return ended };
                warnings.push(format!(
                    "the error asked for, {error:.2e} of the diagonal, was not reached {}; the cage of {} vertices leaves {least:.2e}",
                    if ended.is_break() { "in time".to_owned() } else { format!("with up to {most} vertices") },
                    best.mesh.vertices.len()
                ));
                self.best = best;
                self.missed = true;
            }
        }
        ended
    }

    /// Mean L2 error of the encoder on the choosing frames, over the diagonal; infinite where it
    /// refuses the cage.
    fn encoded_error(&self, best: &Best) -> f64 {
        let Ok(cage) = Cage::new(best.mesh.clone()) else { return f64::INFINITY };
        let options = SolverOptions::for_unknowns(cage.vertices().len());
        let Ok(solver) = Solver::prepare(&MeanValue, &cage, &self.rest.points, options) else { return f64::INFINITY };
        assert!(!solver.follows_previous(), "a solver whose cages do not depend on the frame before");
        let (frames, parts) = self.frames;
        let choosing: Vec<&[f64]> = parts.choosing.iter().map(|&frame| frames[frame].as_slice()).collect();
        let mut errors = Vec::new();
        for frames in evenly(&choosing, MAX_MEASURED_FRAMES).chunks(BATCH) {
            let inverted = solver.invert(Rows::All, None, frames);
            let views: Vec<&[f32]> = inverted.iter().map(|inverted| inverted.cage.as_slice()).collect();
            errors.extend(solver.decoder().measure(&views, frames));
        }
        errors.iter().map(|e| e.l2).sum::<f64>() / errors.len() as f64 / solver.diagonal()
    }
}
