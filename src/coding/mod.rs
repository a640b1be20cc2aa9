//! Coded frames: how large the steps of cages and residual are for what was asked for, and groups of frames as a container holds them.
//!
//! One number, the step of the residual, decides a file's size and error. A step of the cage that moves all points by as much in the root mean square
//! costs as much per binary digit; how far apart the two are best is measured on the first frames, and so is the step that meets an error or a size.

mod group;
mod meshes;
mod steps;

pub(crate) use group::{CodedGroup, GroupCoder, Room};
pub(crate) use meshes::RestMeshes;

/// What a coded file is to meet; errors are fractions of the rest pose's diagonal.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Goal {
    /// No point of any frame is farther from where it was captured.
    MaxError(f64),
    /// The root mean square error of the points, averaged over the frames, is at most this.
    MeanError(f64),
    /// The file has at most so many bytes.
    Size(u64),
    /// Cages alone, in steps that hardly add to their error.
    Preview,
    /// A few steps of residual: errors that are not seen.
    Standard,
}

impl Goal {
    /// The quality for what is to be worked on later.
    pub const MASTER: Self = Self::MaxError(1e-4);
}

/// Why frames cannot be coded as asked for.
#[derive(Debug, thiserror::Error, PartialEq)]
pub enum CodingError {
    /// Below what single precision can hold.
    #[error(
        "an error of {asked:.1e} of the diagonal is below what positions in single precision can hold here; ask for at least {least:.1e}, or move the capture closer to the origin"
    )]
    BelowPrecision {
        /// Asked for.
        asked: f64,
        /// Smallest possible.
        least: f64,
    },
    /// Too little room.
    #[error(
        "{asked} bytes are too few for this capture and cage: the smallest possible file has about {least}; take a smaller cage, or allow more"
    )]
    TooSmall {
        /// Asked for.
        asked: u64,
        /// About the smallest.
        least: u64,
    },
    /// Numbers that cannot be counted in steps.
    #[error(
        "frames {first} to {last} cannot be coded: positions are not finite, or so far apart that no step counts them; encode without a target for error, size or quality"
    )]
    Uncountable {
        /// First frame of the group, from 0.
        first: usize,
        /// Last one.
        last: usize,
    },
    /// A cage with very many vertices.
    #[error(
        "cages of {rows} rows cannot be coded, only up to {most}; encode without a target for error, size or quality, or take a smaller cage"
    )]
    TooManyRows {
        /// Rows of a frame.
        rows: usize,
        /// Most that can be.
        most: usize,
    },
}
