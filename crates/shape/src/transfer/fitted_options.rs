//! How a motion is moved by the fitted cage.

use crate::registration::ObservationOptions;
use cager_geometry::mesh::Point;

use crate::transfer::alignment::AlignBy;
use crate::transfer::pairs::VertexPair;

/// Which pose the target has where the source is at rest.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Pose {
    /// Absolute for like shapes, relative for others, told by the registration's score.
    #[default]
    Auto,
    /// Its own: what the source does to its rest pose, the target does to its own.
    Relative,
    /// The source's: limbs take the source's directions, however the target stands at rest.
    Absolute,
}

/// How a motion is moved by the fitted cage.
#[derive(Clone)]
pub struct FittedOptions<'a> {
    /// Which pose the target has at rest.
    pub pose: Pose,
    /// How the source is laid onto the target before its cage is fitted.
    pub align: AlignBy,
    /// The axis that points up in both, if known: turns are about it alone.
    pub up: Option<Point>,
    /// Vertices that are known to correspond, if any: they pull alignment and registration.
    pub pairs: Vec<VertexPair>,
    /// What samples are drawn by.
    pub seed: u64,
    /// Whether to stop; asked before each stage of a registration.
    pub stopped: &'a (dyn Fn() -> bool + Sync),
}

impl Default for FittedOptions<'_> {
    fn default() -> Self {
        let (pose, align, up) = (Pose::Auto, AlignBy::Surfaces, None);
        Self { pose, align, up, pairs: Vec::new(), seed: 0, stopped: &|| false }
    }
}

impl FittedOptions<'_> {
    /// How samples are drawn.
    pub(crate) fn observation(&self) -> ObservationOptions {
        ObservationOptions { seed: self.seed, ..ObservationOptions::default() }
    }
}
