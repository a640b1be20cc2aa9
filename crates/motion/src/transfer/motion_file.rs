//! A motion that is a `.cager` file.

use cager_capture::decode::{self, DecodeError, Decoding};
use cager_capture::origin::move_from;
use cager_core::cage::Cage;
use cager_formats::{FrameReader, open_frames};
use cager_geometry::mesh::Model;
use std::path::Path;

/// What a `.cager` file says of its motion without decoding a frame, about no origin.
pub struct MotionFile {
    /// The model at rest.
    pub rest: Model,
    /// The cage around it.
    pub cage: Cage,
    /// The number of each frame.
    pub numbers: Vec<f64>,
    /// Frames per second.
    pub frame_rate: Option<f64>,
}

impl MotionFile {
    /// Reads it.
    ///
    /// # Errors
    /// A file that cannot be read or used.
    pub fn open(path: &Path) -> Result<Self, DecodeError> {
        let fail = |cause| DecodeError::container(path, cause);
        let mut container = decode::open(path)?;
        let (origin, frame_rate) = (container.header().origin, container.header().frame_rate);
        let mut rest = container.rest().map_err(fail)?;
        let mut cage = container.cage().map_err(fail)?;
        move_from(origin, &mut rest.points);
        move_from(origin, &mut cage.vertices);
        let mut numbers = container.frame_numbers().map_err(fail)?;
        if numbers.len() != container.frames() {
            numbers = (0..container.frames()).map(|frame| frame as f64).collect();
        }
        let cage = Cage::new(cage).map_err(|cause| DecodeError::Cage { path: path.to_owned(), cause })?;
        Ok(Self { rest, cage, numbers, frame_rate })
    }
}

/// The frames of a `.cager` file of a model of so many points, decoded into a folder.
///
/// # Errors
/// A file that cannot be decoded, and a folder that cannot be written to.
pub fn decoded(path: &Path, points: usize, scratch: &Path) -> Result<Box<dyn FrameReader>, DecodeError> {
    let decoded = scratch.join("decoded.npy");
    decode::decode(path, &*decoded, Decoding::default(), &mut |_| ())?;
    Ok(open_frames(&decoded, points)?)
}
