//! A capture with each frame in a mesh file of its own.

use std::path::PathBuf;

use super::FrameReader;
use crate::error::Error;
use crate::mesh::{Contents, read_file};

/// Reads only the positions: the faces may differ from those of the rest pose.
pub(super) struct SequenceReader {
    files: Vec<PathBuf>,
    points: usize,
    next: usize,
}

impl SequenceReader {
    pub(super) fn new(files: Vec<PathBuf>, points: usize) -> Self {
        Self { files, points, next: 0 }
    }
}

impl FrameReader for SequenceReader {
    fn points(&self) -> usize {
        self.points
    }

    fn frames(&self) -> usize {
        self.files.len()
    }

    fn read_next(&mut self, out: &mut Vec<f64>) -> Result<bool, Error> {
        out.clear();
        let Some(path) = self.files.get(self.next) else {
            return Ok(false);
        };
        let model = read_file(path, Contents::Points).map_err(|error| error.in_frame(self.next))?;
        let found = model.points.len();
        if found != self.points {
            let (path, frame) = (path.clone(), Some(self.next));
            return Err(Error::PointCount { path, frame, expected: self.points, found: found as u64 });
        }
        out.extend_from_slice(model.points.as_flattened());
        self.next += 1;
        Ok(true)
    }

    fn skip(&mut self) -> Result<bool, Error> {
        let more = self.next < self.files.len();
        self.next += usize::from(more);
        Ok(more)
    }
}
