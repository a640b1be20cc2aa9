//! Where surfaces come from: the files of a capture, or what else can give them again.

use super::RecoverError;
use cager_formats::{MeshSequence, read_model};
use cager_geometry::mesh::Model;
use std::path::PathBuf;

/// What became of waiting for a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Arrival {
    /// It can be read.
    There,
    /// There is none: the one before was the last.
    End,
    /// The recovery is to stop, whatever is still to come.
    Stopped,
}

/// Surfaces by their place in the sequence, counted from 0. Any may be read several times.
pub trait SurfaceSource: Sync {
    /// Waits until a frame is there.
    fn wait_for(&self, frame: usize) -> Arrival;

    /// Reads a frame that is there.
    ///
    /// # Errors
    /// Its file cannot be read, or [`RecoverError::Stopped`].
    fn read(&self, frame: usize) -> Result<Model, RecoverError>;

    /// The file of a frame.
    fn file(&self, frame: usize) -> PathBuf;

    /// The numbers of so many frames, where their names tell some.
    fn numbers(&self, frames: usize) -> Option<Vec<f64>>;
}

impl SurfaceSource for MeshSequence {
    fn wait_for(&self, frame: usize) -> Arrival {
        if frame < self.files.len() { Arrival::There } else { Arrival::End }
    }

    fn read(&self, frame: usize) -> Result<Model, RecoverError> {
        Ok(read_model(&self.files[frame])?)
    }

    fn file(&self, frame: usize) -> PathBuf {
        self.files[frame].clone()
    }

    fn numbers(&self, _: usize) -> Option<Vec<f64>> {
        self.numbers.clone()
    }
}
