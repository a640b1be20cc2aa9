//! Recovered frames on their way to the encoder, in a scratch file: they come from last to first.

use cager_formats::{Action, Error, FrameReader};
use cager_geometry::mesh::Point;
use std::fs::File;
use std::io::{BufReader, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

/// Frames × points × 3 numbers in double precision, written in any order.
pub struct RecoveredFrames {
    path: PathBuf,
    file: BufReader<File>,
    points: usize,
    numbers: Vec<f64>,
    frame_rate: Option<f64>,
    next: usize,
}

impl RecoveredFrames {
    /// An empty file in a folder.
    pub(crate) fn create(
        folder: &Path,
        points: usize,
        numbers: Vec<f64>,
        frame_rate: Option<f64>,
    ) -> Result<Self, Error> {
        let path = folder.join("positions");
        let open = || File::options().read(true).write(true).create_new(true).open(&path);
        let file = open().map_err(|cause| Error::Io { path: path.clone(), action: Action::Write, cause })?;
        Ok(Self { path, file: BufReader::with_capacity(1 << 20, file), points, numbers, frame_rate, next: 0 })
    }

    fn frame_bytes(&self) -> u64 {
        24 * self.points as u64
    }

    /// Stores a frame.
    pub(crate) fn write(&mut self, frame: usize, positions: &[Point]) -> Result<(), Error> {
        let bytes: Vec<u8> = positions.as_flattened().iter().flat_map(|x| x.to_le_bytes()).collect();
        let at = SeekFrom::Start(frame as u64 * self.frame_bytes());
        let file = self.file.get_mut();
        let written = file.seek(at).and_then(|_| file.write_all(&bytes));
        written.map_err(|cause| Error::Io { path: self.path.clone(), action: Action::Write, cause })
    }

    /// Begins to read, from the first frame.
    pub fn rewind(&mut self) -> Result<(), Error> {
        self.next = 0;
        self.file.rewind().map_err(|cause| self.unreadable(cause))
    }

    fn unreadable(&self, cause: std::io::Error) -> Error {
        Error::Io { path: self.path.clone(), action: Action::Read, cause }
    }
}

impl FrameReader for RecoveredFrames {
    fn points(&self) -> usize {
        self.points
    }

    fn frames(&self) -> usize {
        self.numbers.len()
    }

    fn frame_rate(&self) -> Option<f64> {
        self.frame_rate
    }

    fn number(&self, frame: usize) -> f64 {
        self.numbers[frame]
    }

    fn read_next(&mut self, out: &mut Vec<f64>) -> Result<bool, Error> {
        if self.next == self.numbers.len() {
            return Ok(false);
        }
        let mut bytes = vec![0; 24 * self.points];
        self.file.read_exact(&mut bytes).map_err(|cause| self.unreadable(cause))?;
        out.clear();
        out.extend(bytes.as_chunks().0.iter().map(|&x| f64::from_le_bytes(x)));
        self.next += 1;
        Ok(true)
    }
}
