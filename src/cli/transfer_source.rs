//! The source of `cager transfer`: a model at rest and its frames, from files or from a .cager file.

use super::checks::{check_capture, checked_files, warn_of_departures};
use super::dry_run::read_files;
use super::motion_args::TransferMotionArgs;
use super::read_with_units;
use anyhow::{Result, bail};
use cager_capture::frames::CaptureFiles;
use cager_capture::timing::Timing;
use cager_core::cage::Cage;
use cager_formats::{Error, FrameReader};
use cager_geometry::mesh::Model;
use cager_motion::transfer::{MotionFile, decoded};
use std::path::{Path, PathBuf};

/// What is moved.
pub(super) struct MotionSource {
    /// At rest.
    pub(super) rest: Model,
    /// The cage that comes with it.
    pub(super) cage: Option<Cage>,
    frames: Frames,
}

enum Frames {
    Files(Box<CaptureFiles>),
    Container { path: PathBuf, numbers: Vec<f64>, frame_rate: Option<f64> },
}

impl MotionSource {
    /// Opens and checks it; no frame of a .cager file is decoded.
    pub(super) fn open(args: &TransferMotionArgs) -> Result<Self> {
        let timing = Timing::from(&args.timing);
        if let Some(path) = &args.source {
            return Self::of_container(path, timing);
        }
        let (Some(rest_path), Some(frames)) = (&args.source_rest, &args.source_frames) else {
            bail!("--source-rest and --source-frames, or --source, say what is moved; give them");
        };
        let (rest, units) = read_with_units(rest_path, &args.checks.prim)?;
        let no_frames = [rest_path, &args.target].into_iter().chain(&args.cage);
        let mut files = checked_files(&args.checks, frames, rest.points.len(), no_frames);
        files.timing = timing;
        files.rest_units = units;
        check_capture(&mut files, (rest_path, &rest), &args.checks)?;
        Ok(Self { rest, cage: None, frames: Frames::Files(Box::new(files)) })
    }

    fn of_container(path: &Path, timing: Timing) -> Result<Self> {
        let MotionFile { rest, cage, numbers, frame_rate } = MotionFile::open(path)?;
        let (numbers, frame_rate) = (timing.numbers(numbers), timing.fps.or(frame_rate));
        Ok(Self { rest, cage: Some(cage), frames: Frames::Container { path: path.to_owned(), numbers, frame_rate } })
    }

    /// Reads and checks what can be without decoding; gives the number of frames.
    pub(super) fn check_frames(&self) -> Result<usize> {
        match &self.frames {
            Frames::Files(files) => read_files(files),
            Frames::Container { numbers, .. } => Ok(numbers.len()),
        }
    }

    /// The frames from the first; those of a .cager file are decoded into a folder first.
    pub(super) fn frames(&self, scratch: &Path) -> Result<Box<dyn FrameReader>> {
        match &self.frames {
            Frames::Files(files) => Ok(files.open()?),
            Frames::Container { path, numbers, frame_rate } => {
                let frames = decoded(path, self.rest.points.len(), scratch)?;
                Ok(Box::new(Timed { frames, numbers: numbers.clone(), frame_rate: *frame_rate }))
            }
        }
    }

    /// Warns of frames that were read although they do not look like those before.
    pub(super) fn warn_of_departures(&self) {
        if let Frames::Files(files) = &self.frames {
            warn_of_departures(files);
        }
    }
}

/// Frames with the numbers and the rate of the file that they were decoded from.
struct Timed {
    frames: Box<dyn FrameReader>,
    numbers: Vec<f64>,
    frame_rate: Option<f64>,
}

impl FrameReader for Timed {
    fn points(&self) -> usize {
        self.frames.points()
    }

    fn frames(&self) -> usize {
        self.frames.frames()
    }

    fn frame_rate(&self) -> Option<f64> {
        self.frame_rate
    }

    fn number(&self, frame: usize) -> f64 {
        self.numbers.get(frame).copied().unwrap_or(frame as f64)
    }

    fn read_next(&mut self, out: &mut Vec<f64>) -> Result<bool, Error> {
        self.frames.read_next(out)
    }

    fn skip(&mut self) -> Result<bool, Error> {
        self.frames.skip()
    }
}
