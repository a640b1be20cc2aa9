//! A container as an animation: frames at random, or all into a file.

use super::bind::{BoundModel, bind};
use super::opened::{Container, DecodeError, open};
use super::{Decoded, Decoding, may_lose};
use crate::memory::{Memory, free_bytes};
use crate::origin::move_from;
use crate::positions::{decoded, points};
use cager_formats::Target;
use cager_geometry::mesh::{Model, Point};
use std::path::{Path, PathBuf};

/// Frames of a container, decoded as they are asked for.
pub struct Animation {
    container: Container,
    model: BoundModel,
    path: PathBuf,
}

impl Animation {
    /// Of a container. Coordinates that a quarter of the free memory does not hold are computed for
    /// each reading.
    ///
    /// # Errors
    /// As [`decode`](super::decode).
    pub fn open(path: impl AsRef<Path>) -> Result<Self, DecodeError> {
        let path = path.as_ref();
        let mut container = open(path)?;
        container.limit_coordinates(free_bytes());
        let memory = Memory::half_of_free();
        // Any number of frames may be read at a time, down to one.
        let most = container.frames();
        let model = bind(&mut container, path, None, None, |points, columns| memory.keeps(points, columns, most))?;
        Ok(Self { container, model, path: path.to_owned() })
    }

    /// Number of frames.
    pub fn frames(&self) -> usize {
        self.container.frames()
    }

    /// The model in its rest pose.
    pub fn rest(&self) -> Model {
        let mut rest = self.model.rest.clone();
        move_from(self.container.header().origin, &mut rest.points);
        rest
    }

    /// The points of a frame, counted from 0.
    ///
    /// # Errors
    /// Damage, or a frame that is not there.
    pub fn frame(&mut self, frame: usize) -> Result<Vec<Point>, DecodeError> {
        let positions = self.read(&[frame])?;
        let mut points = points(&positions[0]);
        move_from(self.container.header().origin, &mut points);
        Ok(points)
    }

    /// Writes all frames to `output` in the format of its name, such as `walk.abc`, `walk.usdc` or
    /// `walk/*.ply`; it appears complete or not at all.
    ///
    /// # Errors
    /// As [`decode`](super::decode).
    pub fn write(&self, output: impl Into<Target>) -> Result<Decoded, DecodeError> {
        super::decode(&self.path, output, Decoding::default(), &mut |_| ())
    }

    /// Positions of these frames, three coordinates a point, less the container's origin.
    ///
    /// # Errors
    /// Damage, or a frame that is not there.
    pub fn read(&mut self, frames: &[usize]) -> Result<Vec<Vec<f32>>, DecodeError> {
        let fail = |cause| DecodeError::container(&self.path, cause);
        let mut cages = vec![Vec::new(); frames.len()];
        for (&frame, cage) in frames.iter().zip(&mut cages) {
            self.container.read_frame(frame, cage).map_err(fail)?;
        }
        let views: Vec<&[f32]> = cages.iter().map(Vec::as_slice).collect();
        let mut positions = decoded(&self.model.decoder, &views);
        self.container.add_residual(frames, &mut positions).map_err(fail)?;
        Ok(positions)
    }

    /// How far positions may move where the origin is added to them in single precision.
    ///
    /// # Errors
    /// Damage.
    pub fn may_lose(&mut self) -> Result<f64, DecodeError> {
        may_lose(&mut self.container).map_err(|cause| DecodeError::container(&self.path, cause))
    }

    /// Where a cage of vertices × 3 takes the model, without residual and less the container's
    /// origin.
    ///
    /// # Panics
    /// Where the cage has not one row for each unknown.
    pub fn of_cage(&self, cage: &[f32]) -> Vec<f32> {
        decoded(&self.model.decoder, &[cage]).swap_remove(0)
    }
}
