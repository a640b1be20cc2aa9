//! What the header of a point cache declares.

use std::io::{self, SeekFrom};
use std::path::Path;

use super::times::Times;
use super::widen::Scalar;
use crate::error::{Error, Fault};

/// Layout of a cache as its header declares it.
#[derive(Debug, PartialEq)]
pub(super) struct Layout {
    pub(super) points: u64,
    pub(super) frames: u64,
    /// Offset of the first coordinate in bytes.
    pub(super) start: u64,
    pub(super) scalar: Scalar,
    pub(super) order: Order,
    /// Of an array whose first index varies fastest: how many rows each frame has.
    pub(super) fortran: Option<u64>,
    /// Where each frame is and how it is stored, where they do not follow each other.
    pub(super) blocks: Vec<(u64, Scalar)>,
    /// When its frames are, where the header tells.
    pub(super) times: Times,
}

/// How the coordinates of a frame follow each other.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Order {
    /// x y z of each point.
    Points,
    /// x y z 1 of each point.
    Homogeneous,
    /// All x, then all y, then all z.
    Axes,
}

impl Order {
    /// Values stored for a point.
    pub(super) fn values(self) -> usize {
        match self {
            Self::Points | Self::Axes => 3,
            Self::Homogeneous => 4,
        }
    }
}

/// Maximum length of a header.
pub(super) const LONGEST_HEADER: usize = 12 + (1 << 16);

impl Layout {
    /// As most formats have it, frames numbered from 0.
    pub(super) fn new(points: u64, frames: u64, start: u64, scalar: Scalar) -> Self {
        let (blocks, times) = (Vec::new(), Times::default());
        Self { points, frames, start, scalar, order: Order::Points, fortran: None, blocks, times }
    }

    /// Where a frame is, which fits as its end is within the file, and how it is stored.
    pub(super) fn block(&self, frame: usize) -> (u64, Scalar) {
        let size = self.points * (self.order.values() * self.scalar.size()) as u64;
        self.blocks.get(frame).copied().unwrap_or((self.start + frame as u64 * size, self.scalar))
    }

    /// Compares what the header promises with the points that are expected and the bytes there are.
    pub(super) fn check(&self, length: u64, expected: usize, path: &Path) -> Result<(), Error> {
        if self.points != expected as u64 {
            return Err(Error::PointCount { path: path.to_owned(), frame: None, expected, found: self.points });
        }
        self.check_size(length).map_err(|fault| fault.at(path))
    }

    fn check_size(&self, length: u64) -> Result<(), Fault> {
        let Self { points, frames, start, scalar, .. } = *self;
        if points == 0 {
            return Err(Fault::invalid("has no points; export the capture with its points"));
        }
        if frames == 0 {
            return Err(Fault::invalid("has no frames; export the capture with its frames"));
        }
        let frame = u128::from(points).saturating_mul((self.order.values() * scalar.size()) as u128);
        let promised = frame.saturating_mul(frames.into()).saturating_add(start.into());
        let length = u128::from(length);
        if length == promised {
            return Ok(());
        }
        let whole = (length.saturating_sub(start.into()) / frame).min(frames.into());
        let difference = if length < promised {
            format!("{} bytes are missing", promised - length)
        } else {
            format!("{} bytes are in excess", length - promised)
        };
        Err(Fault::damaged(format!(
            "promises {frames} frames and has {whole} whole frames, {difference}; copy or export the file again"
        )))
    }
}

/// Where seeking leads in something of `length` bytes.
pub(super) fn offset(at: u64, length: u64, to: SeekFrom) -> io::Result<u64> {
    let found = match to {
        SeekFrom::Start(offset) => Some(offset),
        SeekFrom::Current(by) => at.checked_add_signed(by),
        SeekFrom::End(by) => length.checked_add_signed(by),
    };
    found.filter(|&offset| offset <= length).ok_or_else(|| io::ErrorKind::InvalidInput.into())
}
