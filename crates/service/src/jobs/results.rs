//! Frames that a job encodes, and why its results cannot be made.

use super::{Job, Work};
use crate::problem::{self, ApiError};
use crate::store::StoreError;
use cager_capture::encode::EncodeError;
use cager_formats::{Error, FrameReader};
use std::io;

/// Why results cannot be made.
#[derive(Debug, thiserror::Error)]
pub(crate) enum ResultsError {
    #[error(transparent)]
    Encode(#[from] EncodeError),
    #[error(transparent)]
    Store(#[from] StoreError),
    #[error(transparent)]
    Formats(#[from] Error),
    #[error(transparent)]
    Io(#[from] io::Error),
    #[error(transparent)]
    Json(#[from] serde_json::Error),
}

impl From<&ResultsError> for ApiError {
    fn from(error: &ResultsError) -> Self {
        match error {
            ResultsError::Encode(EncodeError::Coding(error)) => Self::new(problem::INVALID_OPTIONS, error.to_string()),
            ResultsError::Encode(EncodeError::Prepare(error)) => {
                Self::new(problem::INVALID_GEOMETRY, error.to_string())
            }
            ResultsError::Store(error) if error.is_passing() => Self::from(error),
            other => Self::internal(other),
        }
    }
}

/// Frames that end when the work is to stop.
pub(crate) struct Stoppable<'a> {
    pub(crate) frames: &'a mut dyn FrameReader,
    pub(crate) stopped: &'a (dyn Fn() -> bool + Sync),
    /// Frame rate and numbers in place of their own.
    pub(crate) timing: (Option<f64>, Option<Vec<f64>>),
}

impl FrameReader for Stoppable<'_> {
    fn points(&self) -> usize {
        self.frames.points()
    }

    fn frames(&self) -> usize {
        self.frames.frames()
    }

    fn frame_rate(&self) -> Option<f64> {
        self.timing.0.or(self.frames.frame_rate())
    }

    fn number(&self, frame: usize) -> f64 {
        let number = self.timing.1.as_ref().and_then(|numbers| numbers.get(frame));
        number.copied().unwrap_or_else(|| self.frames.number(frame))
    }

    fn read_next(&mut self, out: &mut Vec<f64>) -> Result<bool, Error> {
        Ok(!(self.stopped)() && self.frames.read_next(out)?)
    }
}

/// What reads a job's frames for one client.
pub(crate) trait Frames<W: Work>: Send {
    /// Where frames are to be decoded, the bytes of memory that this takes until the client has them all. They are read in a place among those that decode then.
    fn decodes(&self, _job: &Job<W>) -> Option<u64> {
        None
    }

    /// Frames from `first` on, at most `most`, and none yet where they would have to be decoded without a place (`may_decode`). Blocks.
    ///
    /// # Errors
    /// The job failed or is deleted, or its files cannot be read.
    fn read(&mut self, job: &Job<W>, first: u32, most: u32, may_decode: bool) -> io::Result<Piece>;
}

impl<W: Work, F: FnMut(&Job<W>, u32, u32) -> io::Result<Piece> + Send> Frames<W> for F {
    fn read(&mut self, job: &Job<W>, first: u32, most: u32, _: bool) -> io::Result<Piece> {
        self(job, first, most)
    }
}

/// Frames that follow each other, as bytes for a client.
#[derive(Default)]
pub(crate) struct Piece {
    pub(crate) bytes: Vec<u8>,
    pub(crate) frames: u32,
    /// Whether none will follow.
    pub(crate) is_last: bool,
}
