//! A capture with each frame in a mesh file of its own.

use std::path::PathBuf;

use super::{FrameReader, numbers};
use crate::error::Error;
use crate::mesh::{Contents, read_file};

/// Reads only the positions: the faces may differ from those of the rest pose.
pub(super) struct SequenceReader {
    files: Vec<PathBuf>,
    numbers: Option<Vec<f64>>,
    points: usize,
    next: usize,
}

impl SequenceReader {
    /// In the order of the numbers in the files' names, where those differ by nothing else.
    pub(super) fn new(mut files: Vec<PathBuf>, points: usize) -> Self {
        let numbers = numbers::of_files(&files).map(|found| {
            let mut numbered: Vec<(f64, PathBuf)> = found.into_iter().zip(std::mem::take(&mut files)).collect();
            numbered.sort_by(|a, b| a.0.total_cmp(&b.0));
            let numbers = numbered.iter().map(|(number, _)| *number).collect();
            files = numbered.into_iter().map(|(_, file)| file).collect();
            numbers
        });
        Self { files, numbers, points, next: 0 }
    }
}

impl FrameReader for SequenceReader {
    fn points(&self) -> usize {
        self.points
    }

    fn frames(&self) -> usize {
        self.files.len()
    }

    fn number(&self, frame: usize) -> f64 {
        self.numbers.as_ref().and_then(|numbers| numbers.get(frame)).copied().unwrap_or(frame as f64)
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
