//! What an encoding is made with: a builder whose defaults are those of `cager encode`.

use super::{ChooseSpectrum, EncodeProgress};
use crate::coding::{Goal, InversionChoices};
use crate::frames::CaptureFiles;
use crate::memory::Memory;
use crate::open::Capture;
use cager_core::cage::Cage;
use cager_core::coordinates::{CoordinateSystem, MeanValue};
use cager_core::inversion::SolverOptions;
use cager_geometry::linalg::SparseMatrix;
use cager_geometry::mesh::{Model, Point};
use cager_geometry::units::Units;

/// Encodes a capture: see [`Encode::write`].
pub fn encode(capture: &Capture) -> Encode<'_, &CaptureFiles> {
    Encode::of(&capture.rest, &capture.cage, &capture.files).origin(capture.files.origin)
}

/// An encoding of frames of a rest pose in its cage, with what was asked of it.
#[must_use = "nothing is encoded before it is written"]
pub struct Encode<'a, Files = ()> {
    pub(super) rest: &'a Model,
    pub(super) cage: &'a Cage,
    pub(super) files: Files,
    pub(super) system: &'static dyn CoordinateSystem,
    options: Option<SolverOptions>,
    pub(super) matrix: Option<&'a SparseMatrix>,
    pub(super) choose: Option<ChooseSpectrum>,
    memory: Option<Memory>,
    pub(super) goal: Option<Goal>,
    pub(super) origin: Option<Point>,
    pub(super) units: Units,
    pub(super) exact_rest: bool,
    pub(super) expected: Option<usize>,
    pub(super) progress: &'a dyn Fn(EncodeProgress),
}

impl<'a, Files> Encode<'a, Files> {
    fn of(rest: &'a Model, cage: &'a Cage, files: Files) -> Self {
        Self {
            rest,
            cage,
            files,
            system: &MeanValue,
            options: None,
            matrix: None,
            choose: None,
            memory: None,
            goal: None,
            origin: None,
            units: Units::UNKNOWN,
            exact_rest: false,
            expected: None,
            progress: &|_| (),
        }
    }

    /// Bounds the error of every point of every frame, in diagonals of the rest pose.
    pub fn max_error(self, error: f64) -> Self {
        self.goal(Goal::MaxError(error))
    }

    /// Bounds the root mean square error of the points, averaged over the frames, in diagonals of
    /// the rest pose.
    pub fn mean_error(self, error: f64) -> Self {
        self.goal(Goal::MeanError(error))
    }

    /// What the file is to meet; without a goal the cages are stored as they are solved for.
    pub fn goal(self, goal: impl Into<Option<Goal>>) -> Self {
        Self { goal: goal.into(), ..self }
    }

    /// The cage's coordinates; mean value coordinates by default.
    pub fn coordinates(self, system: &'static dyn CoordinateSystem) -> Self {
        Self { system, ..self }
    }

    /// How cages are solved for; by default as is usual for the goal.
    pub fn solver(self, options: SolverOptions) -> Self {
        Self { options: Some(options), ..self }
    }

    /// The matrix of [`Regularizer::Matrix`](cager_core::regularize::Regularizer::Matrix).
    pub fn matrix(self, matrix: Option<&'a SparseMatrix>) -> Self {
        Self { matrix, ..self }
    }

    /// Selects the spectrum threshold instead of taking that of the solver's options.
    pub fn choose_spectrum(self, choose: Option<ChooseSpectrum>) -> Self {
        Self { choose, ..self }
    }

    /// What the encoding may hold in memory; half of what is free by default.
    pub fn memory(self, memory: Memory) -> Self {
        Self { memory: Some(memory), ..self }
    }

    /// What was subtracted from rest pose, cage and frames, and is added to them when the file is
    /// decoded.
    pub fn origin(self, origin: Option<Point>) -> Self {
        Self { origin, ..self }
    }

    /// What positions mean, as far as it is known.
    pub fn units(self, units: Units) -> Self {
        Self { units, ..self }
    }

    /// Stores rest pose and cage as they are, also where the goal would allow less.
    pub fn exact_rest(self, exact: bool) -> Self {
        Self { exact_rest: exact, ..self }
    }

    /// How many frames will be pushed, where it is known: [`Goal::Size`] asks for it.
    pub fn expect_frames(self, frames: usize) -> Self {
        Self { expected: Some(frames), ..self }
    }

    /// What is called as the encoding goes on.
    pub fn progress(self, progress: &'a dyn Fn(EncodeProgress)) -> Self {
        Self { progress, ..self }
    }

    pub(super) fn solver_options(&self) -> SolverOptions {
        let choices = InversionChoices { is_coded: self.goal.is_some(), ..InversionChoices::coded(self.system) };
        self.options.unwrap_or_else(|| choices.options(self.system.values(self.cage).unknowns()))
    }

    pub(super) fn memory_limit(&self) -> Memory {
        self.memory.unwrap_or_else(Memory::half_of_free)
    }
}

impl<'a> Encode<'a> {
    /// Of frames of this rest pose, in memory or from any reader: see [`Self::start`] and
    /// [`Self::run`].
    pub fn new(rest: &'a Model, cage: &'a Cage) -> Self {
        Self::of(rest, cage, ())
    }
}
