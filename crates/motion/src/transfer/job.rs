//! What is to be moved, and how.

use cager_core::cage::Cage;
use cager_core::coordinates::CoordinateSystem;
use cager_formats::FrameReader;
use cager_geometry::mesh::{Model, Point};
use cager_shape::TransferError;
use cager_shape::transfer::alignment::AlignBy;
use cager_shape::transfer::public_cage::PublicCage;
use cager_shape::transfer::{Pose, VertexPair};
use std::path::Path;

/// How a motion is moved.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum MethodChoice {
    /// By the source's cage, fitted to the target.
    Fitted,
    /// The paper's public cage.
    Public(Public),
    /// The same with the target as rigid as possible, of this weight.
    Rigid(Public, f64),
}

/// A public cage.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Public {
    /// The one that is given.
    Given,
    /// Made around both.
    Made(PublicCage),
}

/// Everything a transfer needs.
pub struct TransferJob<'a> {
    /// The source at rest, with faces.
    pub source: Model,
    /// A cage around it, or a public one where the method takes that; one is made where there is
    /// none.
    pub cage: Option<Cage>,
    /// Its frames.
    pub frames: &'a mut dyn FrameReader,
    /// The target at rest.
    pub target: &'a Model,
    /// How it is moved.
    pub method: MethodChoice,
    /// Which pose the target has at rest.
    pub pose: Pose,
    /// How source and target are aligned.
    pub align: AlignBy,
    /// The axis that points up in both.
    pub up: Option<Point>,
    /// Vertices that correspond, where some are known.
    pub pairs: Vec<VertexPair>,
    /// Whether the detail that a public cage loses is brought back to every frame.
    pub detail: bool,
    /// Coordinates in a public cage.
    pub system: &'static dyn CoordinateSystem,
    /// Whether to stop.
    pub stopped: &'a (dyn Fn() -> bool + Sync),
    /// A folder for frames on their way.
    pub scratch: &'a Path,
}

impl TransferJob<'_> {
    /// Goes on unless it is to stop.
    pub(super) fn go_on(&self) -> Result<(), TransferError> {
        if (self.stopped)() { Err(TransferError::Stopped) } else { Ok(()) }
    }
}
