//! Frames in arrays, read as the frames of files are.

use crate::arrays::FrameView;
use crate::fault::{Fault, of};
use crate::watch::Watch;
use cager_capture::belonging::{Belonging, Pass};
use cager_capture::encode::sample_frames;
use cager_capture::mismatch::{self, mismatches};
use cager_capture::origin::move_to;
use cager_formats::{Error, FrameReader};
use cager_geometry::mesh::{Model, Point};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// The frames of a capture, and how they are read.
#[derive(Clone)]
pub(crate) struct Frames<'a> {
    pub(crate) views: &'a [FrameView<'a>],
    /// The argument that they came in.
    pub(crate) name: &'static str,
    /// Points that each frame has to have.
    pub(crate) points: usize,
    pub(crate) frame_rate: Option<f64>,
    /// The number of each frame; 0, 1, 2, … where the list is empty.
    pub(crate) numbers: Arc<[f64]>,
    /// What is subtracted from all positions.
    pub(crate) origin: Option<Point>,
    /// What every frame is compared with as it is read.
    pub(crate) belonging: Option<Arc<Belonging>>,
    /// Ends the reading where it is stopped.
    pub(crate) watch: &'a Watch,
}

impl<'a> Frames<'a> {
    /// From the first frame on.
    pub(crate) fn open(&self) -> ArrayFrames<'a> {
        ArrayFrames { frames: self.clone(), next: 0, pass: self.belonging.clone().map(Pass::new) }
    }

    /// Refuses frames that look as if they did not belong to the rest pose, now or as they are read, unless the user goes on all the same.
    pub(crate) fn check(&mut self, rest: &Model, force: bool) -> Result<(), Fault> {
        if self.views.is_empty() {
            return Err(of(self.name, "has no frames; give at least one"));
        }
        if force {
            return Ok(());
        }
        let samples =
            sample_frames(&mut self.open(), mismatch::FRAMES, false).map_err(|error| Fault::Told(error.to_string()))?;
        let found = mismatches(rest, &samples);
        let Some(first) = found.first() else {
            self.belonging = Belonging::new((Path::new("rest"), rest), false, ", or pass force=True to go on");
            return Ok(());
        };
        let advice = first.advice();
        let words: Vec<String> = found.iter().map(ToString::to_string).collect();
        let what = format!(
            "does not look like a capture of rest: {}; {advice}, or pass force=True to go on",
            words.join(", and ")
        );
        Err(of(self.name, what))
    }
}

/// Reads [`Frames`].
pub(crate) struct ArrayFrames<'a> {
    frames: Frames<'a>,
    next: usize,
    pass: Option<Pass>,
}

impl ArrayFrames<'_> {
    fn invalid(&self, what: String) -> Error {
        Error::Invalid { path: self.path(), what }
    }

    fn path(&self) -> PathBuf {
        PathBuf::from(self.frames.name)
    }
}

impl FrameReader for ArrayFrames<'_> {
    fn points(&self) -> usize {
        self.frames.points
    }

    fn frames(&self) -> usize {
        self.frames.views.len()
    }

    fn frame_rate(&self) -> Option<f64> {
        self.frames.frame_rate
    }

    fn number(&self, frame: usize) -> f64 {
        self.frames.numbers.get(frame).copied().unwrap_or(frame as f64)
    }

    fn read_next(&mut self, out: &mut Vec<f64>) -> Result<bool, Error> {
        out.clear();
        let Some(view) = self.frames.views.get(self.next) else { return Ok(false) };
        if self.frames.watch.is_stopped() {
            return Err(self.invalid("stopped".to_owned()));
        }
        let (frame, expected, found) = (self.next, self.frames.points, view.points());
        if found != expected {
            return Err(Error::PointCount { path: self.path(), frame: Some(frame), expected, found: found as u64 });
        }
        view.write_to(out);
        if let Some(at) = out.iter().position(|x| !x.is_finite()) {
            return Err(Error::NonFinite { path: self.path(), frame, point: at / 3 });
        }
        if let Some(at) = out.iter().position(|x| x.abs() > f64::from(f32::MAX)) {
            return Err(self.invalid(format!(
                "frame {frame}: point {} has the coordinate {:e}, too large for single precision; repair the frame or scale the capture down",
                at / 3,
                out[at]
            )));
        }
        move_to(self.frames.origin, out.as_chunks_mut().0);
        self.next += 1;
        if let Some(pass) = &mut self.pass {
            pass.compare(out.as_chunks().0, None, Path::new(self.frames.name), frame as f64)?;
        }
        Ok(true)
    }

    fn skip(&mut self) -> Result<bool, Error> {
        let more = self.next < self.frames.views.len();
        self.next += usize::from(more);
        // What is skipped is not compared, so neither is what follows.
        self.pass = None;
        Ok(more)
    }
}

/// Edited cages.
pub(crate) struct Cages {
    pub(crate) cages: Arc<[Vec<f64>]>,
    pub(crate) rows: usize,
    pub(crate) next: usize,
}

impl FrameReader for Cages {
    fn points(&self) -> usize {
        self.rows
    }

    fn frames(&self) -> usize {
        self.cages.len()
    }

    fn read_next(&mut self, out: &mut Vec<f64>) -> Result<bool, Error> {
        out.clear();
        let Some(cage) = self.cages.get(self.next) else { return Ok(false) };
        let (path, frame) = (|| PathBuf::from("cages"), self.next);
        if cage.len() != 3 * self.rows {
            return Err(Error::PointCount {
                path: path(),
                frame: Some(frame),
                expected: self.rows,
                found: cage.len() as u64 / 3,
            });
        }
        if let Some(at) = cage.iter().position(|x| !x.is_finite()) {
            return Err(Error::NonFinite { path: path(), frame, point: at / 3 });
        }
        out.extend_from_slice(cage);
        self.next += 1;
        Ok(true)
    }

    fn skip(&mut self) -> Result<bool, Error> {
        let more = self.next < self.cages.len();
        self.next += usize::from(more);
        Ok(more)
    }
}
