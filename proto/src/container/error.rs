//! What can go wrong with a container, sorted by what a caller can do.

use std::io;

/// Why a container cannot be read or written; the caller adds the file's name.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// Some other kind of file.
    #[error("is not a .cager file: its first bytes differ; name a file that cager encode wrote")]
    NotAContainer,
    /// A later layout.
    #[error("has version {0} of the format, and this program reads version 1; use a newer cager")]
    NewerVersion(u16),
    /// A required section of a later program.
    #[error(
        "needs the feature {0:?}, which this program does not have; use a newer cager, or encode the capture again where one before 0.2.0 wrote it"
    )]
    UnknownSection(String),
    /// Bytes were changed or are missing.
    #[error("is damaged at byte {offset}: {what}; get the file again")]
    Corrupt {
        /// Where in the file.
        offset: u64,
        /// What does not fit.
        what: String,
    },
    /// A frame beyond the last.
    #[error("has frames 0 to {last}, so there is no frame {frame}", last = .frames.saturating_sub(1))]
    NoSuchFrame {
        /// The frame asked for.
        frame: usize,
        /// Number of frames.
        frames: usize,
    },
    /// A cage that cannot be stored.
    #[error("frame {frame} cannot be stored: {what}")]
    BadFrame {
        /// The frame, from 0.
        frame: usize,
        /// What is wrong with it.
        what: String,
    },
    /// Too large for the format.
    #[error("cannot be stored: {0}")]
    TooLarge(String),
    /// What readers would refuse: a mesh, frame numbers, groups beside single frames, a report.
    #[error("cannot be stored: {0}")]
    Invalid(String),
    /// Coordinates that cages are coded by, and that would take more memory than they may.
    #[error("needs {:.1} GB of memory for its coordinates, where {:.1} GB may be taken; read it where there is more", 1e-9 * *.needed as f64, 1e-9 * *.most as f64)]
    Memory {
        /// Bytes that they would take.
        needed: u64,
        /// Bytes that they may take, see `limit_coordinates` of the reader.
        most: u64,
    },
    /// The operating system refused.
    #[error("{0}")]
    Io(#[from] io::Error),
}

impl Error {
    pub(crate) fn corrupt(offset: u64, what: impl Into<String>) -> Self {
        Self::Corrupt { offset, what: what.into() }
    }
}
