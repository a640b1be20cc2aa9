//! Recovered animations on their way into a container.

use cager_capture::coding::{Goal, InversionChoices};
use cager_capture::encode::{Encode, EncodeError, EncodeProgress, Encoded};
use cager_core::cage::Cage;
use cager_core::coordinates::CoordinateSystem;
use cager_core::inversion::Handles;
use cager_core::regularize::Regularizer;
use cager_formats::{FrameReader, Target, Units};
use cager_geometry::mesh::{Model, Point};

/// How a recovered animation is stored.
pub struct Encoding<'a> {
    /// Where the file goes.
    pub output: &'a Target,
    /// Coordinates of the cage.
    pub system: &'static dyn CoordinateSystem,
    /// What the file is to meet; without it cages alone are stored.
    pub goal: Option<Goal>,
    /// Whether points may have left their cages.
    pub offsets: bool,
    /// What was subtracted from all positions.
    pub origin: Option<Point>,
    /// What positions mean, as far as it is known.
    pub units: Units,
    /// Whether the rest pose is stored as it is rather than on a grid.
    pub exact_rest: bool,
}

impl Encoding<'_> {
    /// Encodes the frames of a template in its cage.
    pub fn write(
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
        let encode = Encode::new(rest, cage).coordinates(system).solver(options).goal(goal).origin(origin);
        encode.units(units).exact_rest(exact_rest).progress(progress).run(frames, output)
    }
}
