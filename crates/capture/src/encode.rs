//! Encoding: solves one cage per frame and measures the errors that a decoder will produce.
//!
//! [`encode()`] takes a [`Capture`](crate::Capture) of files, [`Encode`] any rest pose, cage and
//! frames, and [`Encoder`] frames one by one.

mod batches;
mod encoder;
mod options;
mod sink;

pub use encoder::Encoder;
pub use options::{Encode, encode};

use crate::coding::CodingError;
use crate::decode::DecodeError;
use crate::mismatch::Mismatch;
use cager_cages::DesignError;
use cager_core::cage::CageError;
use cager_core::inversion::PrepareError;
use cager_formats::{Action, AtomicFile, FrameReader, commit_together};
use cager_proto::container;
use cager_proto::report::Report;
use std::path::{Path, PathBuf};

/// Largest memory of sampled frames, in bytes; constant, so that choices are reproducible.
const SAMPLE_BYTES: usize = 640 << 20;

/// Why encoding stopped; nothing was written.
#[derive(Debug, thiserror::Error)]
pub enum EncodeError {
    /// The cage in a file is invalid.
    #[error("{}: {cause}", .path.display())]
    Cage {
        /// The file.
        path: PathBuf,
        /// What is wrong with it; part of the message, so not a source as well.
        cause: CageError,
    },
    /// The `.cager` file of a cage cannot be read.
    #[error(transparent)]
    Decode(#[from] DecodeError),
    /// Rest pose, cage and frames look as if they did not belong together.
    #[error("{what}{}", found.first().map_or_else(String::new, |found| format!("; {}", found.advice())))]
    Mismatch {
        /// Which file does not look like what.
        what: String,
        /// How the frames differ from the rest pose; nothing where it is the cage that does.
        found: Vec<Mismatch>,
    },
    /// Frames have as many points as the rest pose would where points that seams split are one.
    #[error("{cause}; seams split points of {} that are one in the frames: merge them", .rest.display())]
    Seams {
        /// The file of the rest pose.
        rest: PathBuf,
        /// The numbers of points.
        cause: cager_formats::Error,
    },
    /// No cage can be designed for the capture.
    #[error(transparent)]
    Design(#[from] DesignError),
    /// The rest pose and its cage cannot be used.
    #[error(transparent)]
    Prepare(#[from] PrepareError),
    /// The frames could not be read, or the output not be created.
    #[error(transparent)]
    Formats(#[from] cager_formats::Error),
    /// The frames cannot be coded as asked for.
    #[error(transparent)]
    Coding(#[from] CodingError),
    /// The frames end before they should.
    #[error("ends after {found} frames where {announced} are announced; get the capture again")]
    EndsEarly {
        /// Frames that could be read.
        found: usize,
        /// Frames that the reader announced.
        announced: usize,
    },
    /// A frame that was pushed has other points than the rest pose.
    #[error(
        "frame {frame} has {found} points where the rest pose has {expected}; give every point of the rest pose in its order"
    )]
    PointCount {
        /// The frame, from 0.
        frame: usize,
        /// Its points.
        found: usize,
        /// Points of the rest pose.
        expected: usize,
    },
    /// A frame that was pushed has a coordinate that single precision does not hold.
    #[error("frame {frame}: point {point} is not finite, or too large for single precision")]
    NotFinite {
        /// The frame, from 0.
        frame: usize,
        /// The point, from 0.
        point: usize,
    },
    /// An earlier call failed, so that frames would be missing from the file.
    #[error("frame {frame} or one after it could not be encoded before; begin again with a new encoder")]
    Stopped {
        /// The first frame that is not in the file, from 0.
        frame: usize,
    },
    /// A size was asked for, and how many frames share it is not known.
    #[error("a size is shared by the frames; say how many are pushed with Encode::expect_frames")]
    UnknownLength,
    /// The container could not be written.
    #[error("{}: {cause}", .path.display())]
    Container {
        /// The output.
        path: PathBuf,
        /// What went wrong; part of the message, so not a source as well.
        cause: container::Error,
    },
}

impl EncodeError {
    fn container(path: &Path, cause: container::Error) -> Self {
        match cause {
            container::Error::Io(io) => Self::Formats(unwritable(path, io)),
            cause => Self::Container { path: path.to_owned(), cause },
        }
    }
}

/// Why an output cannot be written; errors of `AtomicFile` name the path already.
pub(crate) fn unwritable(path: &Path, cause: std::io::Error) -> cager_formats::Error {
    let named = |cause| cager_formats::Error::Io { path: path.to_owned(), action: Action::Write, cause };
    cause.downcast().unwrap_or_else(named)
}

/// How to select a spectrum threshold.
pub struct ChooseSpectrum {
    /// Some frames of the capture, at least one: see [`sample_frames`].
    pub samples: Vec<Vec<f64>>,
    /// Largest extra L2 error, as a fraction of that at threshold 0.
    pub bound: f64,
}

/// Reads at most `most` frames, evenly spaced or the first ones; fewer if memory is limited.
///
/// # Errors
/// Those of the reader, also where it ends before the frames it announced.
pub fn sample_frames(
    frames: &mut dyn FrameReader,
    most: usize,
    first_ones: bool,
) -> Result<Vec<Vec<f64>>, EncodeError> {
    let total = frames.frames();
    let count = most.min(SAMPLE_BYTES / (24 * frames.points().max(1))).clamp(1, total.max(1));
    let mut samples = Vec::with_capacity(count);
    let mut at = 0;
    for k in 0..count {
        let wanted = match count {
            _ if first_ones => k,
            1 => total / 2,
            _ => k * (total - 1) / (count - 1),
        };
        while at < wanted && frames.skip()? {
            at += 1;
        }
        let mut frame = Vec::new();
        if at < wanted || !frames.read_next(&mut frame)? {
            return Err(EncodeError::EndsEarly { found: at, announced: total });
        }
        at += 1;
        samples.push(frame);
    }
    Ok(samples)
}

/// Result of an encoding.
#[derive(Debug)]
pub struct Encoded {
    /// Report of the encoding.
    pub report: Report,
    /// The container, complete but for its name, so that a report can take its name together with
    /// it: see [`cager_formats::commit_together`].
    pub container: AtomicFile,
}

impl Encoded {
    /// Gives the container its name.
    ///
    /// # Errors
    /// An output that refuses.
    pub fn commit(self) -> Result<Report, EncodeError> {
        commit_together(vec![self.container])?;
        Ok(self.report)
    }
}

/// Progress of an encoding.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum EncodeProgress {
    /// What is prepared next.
    Preparing(&'static str),
    /// So many frames are done.
    Frames(usize),
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Announces more frames than it has.
    struct Short {
        left: usize,
    }

    impl FrameReader for Short {
        fn points(&self) -> usize {
            1
        }

        fn frames(&self) -> usize {
            10
        }

        fn read_next(&mut self, out: &mut Vec<f64>) -> Result<bool, cager_formats::Error> {
            *out = vec![0.0; 3];
            let more = self.left > 0;
            self.left = self.left.saturating_sub(1);
            Ok(more)
        }
    }

    #[test]
    fn a_reader_that_ends_early_is_told_and_no_sample_is_empty() {
        for first_ones in [false, true] {
            for left in 0..10 {
                let error = sample_frames(&mut Short { left }, 24, first_ones).expect_err("too few frames");
                assert!(matches!(error, EncodeError::EndsEarly { found, announced: 10 } if found == left), "{error}");
            }
            assert_eq!(sample_frames(&mut Short { left: 10 }, 24, first_ones).expect("all").len(), 10);
        }
    }
}
