//! Sessions as the API returns them.

use super::frames::RANGES;
use super::{Phase, Session};
use crate::preparation::ValidOptions;
use crate::sync::lock;
use cager_capture::coding::InversionChoices;
use cager_core::inversion::SolverOptions;
use cager_core::regularize::Regularizer;
use cager_proto::messages::{FrameCounts, Progress, Session as View, SessionState};
use std::sync::atomic::Ordering;

impl Session {
    /// State and frame counts, for server-sent events.
    pub(crate) fn progress(&self) -> Progress {
        let state = state_of(&lock(&self.status).phase);
        let frames = self.frames();
        Progress {
            state,
            received: frames.received_count() + self.queued.load(Ordering::Relaxed),
            solved: frames.solved_count(),
            coded: self.coded_frames(),
        }
    }

    /// The session as returned by the API.
    pub(crate) fn view(&self) -> View {
        self.view_with(RANGES)
    }

    /// As [`Self::view`], with at most so many ranges of missing frames.
    pub(crate) fn view_with(&self, ranges: usize) -> View {
        let status = self.status();
        let (options, facts) = (&self.meta.options, status.facts.as_ref());
        let frames = {
            let frames = self.frames();
            let missing = frames.missing(0, self.declared(), ranges);
            FrameCounts {
                received: frames.received_count() + self.queued.load(Ordering::Relaxed),
                solved: frames.solved_count(),
                missing: missing.ranges,
                missing_next: missing.next,
            }
        };
        let usual = SolverOptions::default();
        let inversion = ValidOptions::of(options).ok().map(|valid| valid.inversion);
        let or = |given: &Option<String>, default: &str| given.clone().unwrap_or_else(|| default.to_owned());
        let problem = match &status.phase {
            Phase::Failed(problem) => Some((**problem).clone()),
            _ => self.container_problem().map(|error| *error.problem),
        };
        View {
            id: self.meta.id.clone(),
            name: self.name(),
            state: state_of(&status.phase),
            created: self.meta.created_ms as f64 / 1e3,
            points: facts.map(|f| f.points),
            unknowns: facts.map(|f| f.unknowns),
            handle_count: facts.map(|f| f.handle_count),
            cage_vertices: facts.map(|f| f.cage_vertices),
            cage_faces: facts.map(|f| f.cage_faces),
            coordinates: or(&options.coordinates, "mvc"),
            handles: inversion.map_or(usual.handles, InversionChoices::handles).name().to_owned(),
            regularizer: or(&options.regularizer, Regularizer::default().name()),
            spectrum: facts.map(|f| f.spectrum).or(options.spectrum),
            lambda: inversion.map_or(usual.lambda, InversionChoices::lambda),
            condition_number: facts.map(|f| f.condition_number),
            rank: facts.map(|f| f.rank),
            affine_reproduction_error: facts.map(|f| f.affine_reproduction_error),
            frames,
            coding: self.coding_view(facts),
            cache: facts.map(|f| f.cache),
            seconds: facts.map_or_else(Default::default, |f| f.seconds),
            warnings: facts.map_or_else(Vec::new, |f| f.warnings.clone()),
            problem,
        }
    }
}

fn state_of(phase: &Phase) -> SessionState {
    match phase {
        Phase::Preparing => SessionState::Preparing,
        Phase::Ready => SessionState::Ready,
        Phase::Completed(_) => SessionState::Completed,
        Phase::Failed(_) => SessionState::Failed,
    }
}
