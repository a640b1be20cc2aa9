//! Why a motion was not moved.

use cager_cages::EncloseError;
use cager_core::cage::CageError;

/// Why a motion was not moved; nothing was written.
#[derive(Debug, thiserror::Error)]
pub enum TransferFailed {
    /// A frame cannot be read, or the scratch file not be written.
    #[error(transparent)]
    Formats(#[from] cager_formats::Error),
    /// Source, target and frames do not go together.
    #[error(transparent)]
    Transfer(#[from] cager_shape::TransferError),
    /// No cage can be made.
    #[error("no cage can be made around the {whose}: {error}")]
    Enclose {
        /// Source or target.
        whose: &'static str,
        /// Why not.
        error: EncloseError,
    },
    /// A cage that was made cannot be used.
    #[error("the cage that was made around the {whose} cannot be used: {error}; give one")]
    Cage {
        /// What is inside.
        whose: &'static str,
        /// What is wrong with it.
        error: CageError,
    },
    /// A point cloud where faces are needed.
    #[error("the {0} has no faces; this needs a mesh with faces, not a point cloud")]
    NoFaces(&'static str),
    /// Points outside a cage that is given, whose coordinates end there.
    #[error(
        "{} of the {whose} {} outside the cage (the first is point {first}), where {system} coordinates do not exist; take a larger cage, or mean value coordinates (mvc)",
        if *.count == 1 { "1 point".to_owned() } else { format!("{count} points") },
        if *.count == 1 { "lies" } else { "lie" }
    )]
    Outside {
        /// Source or target.
        whose: &'static str,
        /// How many.
        count: usize,
        /// The first of them.
        first: u32,
        /// The name of the coordinates.
        system: &'static str,
    },
    /// No cage around both, where the method takes one that is given.
    #[error("no cage around source and target is there; give one, or name the shape of one that is made")]
    NoCage,
    /// No frames at all.
    #[error("the source has no frames")]
    NoFrames,
    /// The frames end before they should.
    #[error("ends after {found} frames where {announced} are announced; get the frames again")]
    EndsEarly {
        /// Frames that could be read.
        found: usize,
        /// Frames that the reader announced.
        announced: usize,
    },
}
