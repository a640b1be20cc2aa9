//! Point caches: a header, then the coordinates of all frames as one array.

use std::io::{Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

use super::widen::{Scalar, widen};
use super::{CacheFormat, FrameReader, mdd, npy, pc2};
use crate::error::{Error, Fault};

/// What a header promises.
#[derive(Debug, PartialEq)]
pub(super) struct Layout {
    pub(super) points: u64,
    pub(super) frames: u64,
    /// Offset of the first coordinate in bytes.
    pub(super) start: u64,
    pub(super) scalar: Scalar,
    /// Frames per second, where the header tells.
    pub(super) frame_rate: Option<f64>,
}

/// No header that is read here is longer.
pub(super) const LONGEST_HEADER: usize = 12 + (1 << 16);

/// Bytes read at once: few calls, and still within the fast caches.
const BLOCK: usize = 1 << 17;

pub(super) struct CacheReader<R> {
    path: PathBuf,
    source: R,
    start: u64,
    scalar: Scalar,
    frame_rate: Option<f64>,
    points: usize,
    frames: usize,
    next: usize,
    block: Vec<u8>,
}

impl<R: Read + Seek> CacheReader<R> {
    /// Reads the header and compares its promise with `length`, the bytes there are, and with the points that are
    /// expected.
    pub(super) fn open(
        format: CacheFormat,
        path: &Path,
        mut source: R,
        length: u64,
        expected_points: usize,
    ) -> Result<Self, Error> {
        let mut head = Vec::new();
        source.by_ref().take(LONGEST_HEADER as u64).read_to_end(&mut head).map_err(|cause| Error::read(path, cause))?;
        let layout = match format {
            CacheFormat::Npy => npy::layout(&head),
            CacheFormat::Pc2 => pc2::layout(&head),
            CacheFormat::Mdd => mdd::layout(&head),
        };
        let layout = layout.map_err(|fault| fault.at(path))?;
        if layout.points != expected_points as u64 {
            let (path, found) = (path.to_owned(), layout.points);
            return Err(Error::PointCount { path, frame: None, expected: expected_points, found });
        }
        layout.check_size(length).map_err(|fault| fault.at(path))?;
        Ok(Self {
            path: path.to_owned(),
            source,
            start: layout.start,
            scalar: layout.scalar,
            frame_rate: layout.frame_rate,
            points: expected_points,
            // No more than the bytes of the file, which fit.
            frames: layout.frames as usize,
            next: 0,
            block: Vec::new(),
        })
    }
}

impl Layout {
    fn check_size(&self, length: u64) -> Result<(), Fault> {
        let Self { points, frames, start, scalar, .. } = *self;
        if points == 0 {
            return Err(Fault::invalid("has no points; export the capture with its points"));
        }
        if frames == 0 {
            return Err(Fault::invalid("has no frames; export the capture with its frames"));
        }
        let frame = u128::from(points).saturating_mul(3 * scalar.size() as u128);
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

impl<R: Read + Seek + Send> FrameReader for CacheReader<R> {
    fn points(&self) -> usize {
        self.points
    }

    fn frames(&self) -> usize {
        self.frames
    }

    fn frame_rate(&self) -> Option<f64> {
        self.frame_rate
    }

    fn read_next(&mut self, out: &mut Vec<f64>) -> Result<bool, Error> {
        if self.next == self.frames {
            out.clear();
            return Ok(false);
        }
        let size = self.scalar.size();
        // Every value is overwritten below.
        out.resize(3 * self.points, 0.0);
        self.block.resize(BLOCK.min(out.len() * size), 0);
        // Fits, as the end of the last frame is the size of the file.
        let offset = self.start + (self.next * out.len() * size) as u64;
        let read = |cause| Error::read(&self.path, cause);
        self.source.seek(SeekFrom::Start(offset)).map_err(read)?;
        let mut finite = true;
        for values in out.chunks_mut(BLOCK / size) {
            let bytes = &mut self.block[..values.len() * size];
            self.source.read_exact(bytes).map_err(read)?;
            finite &= widen(self.scalar, bytes, values);
        }
        if !finite {
            let culprit = out.iter().position(|x| !x.is_finite()).unwrap_or(0);
            let (path, frame) = (self.path.clone(), self.next);
            return Err(Error::NonFinite { path, frame, point: culprit / 3 });
        }
        self.next += 1;
        Ok(true)
    }

    fn skip(&mut self) -> Result<bool, Error> {
        let more = self.next < self.frames;
        self.next += usize::from(more);
        Ok(more)
    }
}
