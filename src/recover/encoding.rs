//! Recovered animations on their way into a container.

use crate::coding::{Goal, InversionChoices};
use crate::encode::{self, EncodeError, EncodeProgress, Encoded, Job};
use crate::memory::Memory;
use cager_core::cage::Cage;
use cager_core::coordinates::CoordinateSystem;
use cager_core::inversion::Handles;
use cager_core::regularize::Regularizer;
use cager_formats::{FrameReader, Target, Units};
use cager_geometry::mesh::{Model, Point};

/// How a recovered animation is stored.
pub(crate) struct Encoding<'a> {
    pub(crate) output: &'a Target,
    pub(crate) system: &'static dyn CoordinateSystem,
    /// What the file is to meet; without it cages alone are stored.
    pub(crate) goal: Option<Goal>,
    /// Whether points may have left their cages.
    pub(crate) offsets: bool,
    pub(crate) origin: Option<Point>,
    pub(crate) units: Units,
    pub(crate) exact_rest: bool,
}

impl Encoding<'_> {
    /// Encodes the frames of a template in its cage.
    pub(crate) fn write(
        self,
        (rest, cage): (&Model, &Cage),
        frames: &mut dyn FrameReader,
        progress: &dyn Fn(EncodeProgress),
    ) -> Result<Encoded, EncodeError> {
        let Self { output, system, goal, offsets, origin, units, exact_rest } = self;
        // Where points stay in their cages, all of them tell these exactly.
        let exact = goal.is_none() && !offsets;
        let choices = InversionChoices {
            system,
            handles: exact.then_some(Handles::All),
            regularizer: Regularizer::default(),
            spectrum: exact.then_some(0),
            lambda: None,
            is_coded: goal.is_some(),
        };
        let options = choices.options(system.values(cage).unknowns());
        let memory = Memory::half_of_free();
        let job = Job {
            rest,
            cage,
            frames,
            output,
            system,
            options,
            matrix: None,
            choose: None,
            memory,
            goal,
            origin,
            units,
            exact_rest,
        };
        encode::encode(job, progress)
    }
}
