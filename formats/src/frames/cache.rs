//! Point caches: a header, then the coordinates of all frames as one array.

use std::io::{self, Cursor, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

use super::widen::{Scalar, widen};
use super::{CacheFormat, FrameReader, mdd, npy, pc2};
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
    /// The shape of an array whose first index varies fastest.
    pub(super) fortran: Option<Vec<u64>>,
    /// Frames per second, where the header tells.
    pub(super) frame_rate: Option<f64>,
    /// Number of the first frame, and the distance of two.
    pub(super) first: f64,
    pub(super) step: f64,
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
    fn values(self) -> usize {
        match self {
            Self::Points | Self::Axes => 3,
            Self::Homogeneous => 4,
        }
    }
}

/// Maximum length of a header.
pub(super) const LONGEST_HEADER: usize = 12 + (1 << 16);

/// Bytes read at once: few calls, and still within the fast caches.
const BLOCK: usize = 1 << 17;

/// Opens a cache: reads the header and compares its promise with `length`, the bytes there are, and with the points that are expected.
pub(super) fn open<'a>(
    format: CacheFormat,
    path: &Path,
    mut source: impl Read + Seek + Send + 'a,
    length: u64,
    expected_points: usize,
) -> Result<Box<dyn FrameReader + 'a>, Error> {
    let read = |cause| Error::read(path, cause);
    let mut head = Vec::new();
    source.by_ref().take(LONGEST_HEADER as u64).read_to_end(&mut head).map_err(read)?;
    let expected = expected_points as u64;
    let layout = match format {
        CacheFormat::Npy => npy::layout(&head, expected),
        CacheFormat::Pc2 => pc2::layout(&head),
        CacheFormat::Mdd => mdd::layout(&head),
    };
    let mut layout = layout.map_err(|fault| fault.at(path))?;
    if layout.points != expected {
        if layout.frames == expected && format == CacheFormat::Npy {
            let what = format!(
                "has the shape ({expected}, {}, 3), points before frames; convert it with numpy.save(path, numpy.load(path).transpose(1, 0, 2))",
                layout.points
            );
            return Err(Fault::unsupported(what).at(path));
        }
        let (path, found) = (path.to_owned(), layout.points);
        return Err(Error::PointCount { path, frame: None, expected: expected_points, found });
    }
    layout.check_size(length).map_err(|fault| fault.at(path))?;
    let Some(shape) = layout.fortran.take() else {
        return Ok(Box::new(CacheReader::new(path, source, &layout, expected_points)));
    };
    // Every frame is spread over the whole array.
    let mut bytes = Vec::new();
    source.seek(SeekFrom::Start(layout.start)).map_err(read)?;
    source.read_to_end(&mut bytes).map_err(read)?;
    layout.start = 0;
    let last_fastest = Cursor::new(reordered(&bytes, &shape, layout.scalar.size()));
    Ok(Box::new(CacheReader::new(path, last_fastest, &layout, expected_points)))
}

/// An array whose first index varies fastest, in the order in which the last one does.
fn reordered(bytes: &[u8], shape: &[u64], size: usize) -> Vec<u8> {
    // The array has as many bytes as its shape says, so that all of this fits.
    let [a, b, c] = match *shape {
        [a, b] => [1, a as usize, b as usize],
        [a, b, c] => [a as usize, b as usize, c as usize],
        _ => return bytes.to_vec(),
    };
    let mut out = Vec::with_capacity(bytes.len());
    for i in 0..a {
        for j in 0..b {
            for k in 0..c {
                let at = size * (i + a * (j + b * k));
                out.extend_from_slice(&bytes[at..at + size]);
            }
        }
    }
    out
}

struct CacheReader<R> {
    path: PathBuf,
    source: R,
    start: u64,
    scalar: Scalar,
    order: Order,
    frame_rate: Option<f64>,
    first: f64,
    step: f64,
    points: usize,
    frames: usize,
    next: usize,
    block: Vec<u8>,
    /// A frame in an order of its own.
    stored: Vec<f64>,
}

impl<R: Read + Seek> CacheReader<R> {
    fn new(path: &Path, source: R, layout: &Layout, points: usize) -> Self {
        Self {
            path: path.to_owned(),
            source,
            start: layout.start,
            scalar: layout.scalar,
            order: layout.order,
            frame_rate: layout.frame_rate,
            first: layout.first,
            step: layout.step,
            points,
            // No more than the bytes of the file, which fit.
            frames: layout.frames as usize,
            next: 0,
            block: Vec::new(),
            stored: Vec::new(),
        }
    }

    /// Reads the next frame as it is stored; gives whether all is finite.
    fn read_values(&mut self, out: &mut Vec<f64>) -> io::Result<bool> {
        let size = self.scalar.size();
        // Every value is overwritten below.
        out.resize(self.order.values() * self.points, 0.0);
        self.block.resize(BLOCK.min(out.len() * size), 0);
        // Fits, as the end of the last frame is the size of the file.
        let offset = self.start + (self.next * out.len() * size) as u64;
        self.source.seek(SeekFrom::Start(offset))?;
        let mut finite = true;
        for values in out.chunks_mut(BLOCK / size) {
            let bytes = &mut self.block[..values.len() * size];
            self.source.read_exact(bytes)?;
            finite &= widen(self.scalar, bytes, values);
        }
        Ok(finite)
    }

    /// Brings the stored frame into the order of points.
    fn arrange(&self, out: &mut Vec<f64>) -> Result<(), Error> {
        let n = self.points;
        out.clear();
        if self.order == Order::Axes {
            out.extend((0..n).flat_map(|i| [0, 1, 2].map(|k| self.stored[k * n + i])));
            return Ok(());
        }
        for (point, &[x, y, z, w]) in self.stored.as_chunks().0.iter().enumerate() {
            if w != 1.0 {
                out.clear();
                let what = format!(
                    "frame {}: point {point} has the fourth coordinate {w} where only 1 has a meaning; save the first three of them",
                    self.next
                );
                return Err(Fault::unsupported(what).at(&self.path));
            }
            out.extend([x, y, z]);
        }
        Ok(())
    }
}

impl Layout {
    /// As most formats have it, frames numbered from 0.
    pub(super) fn new(points: u64, frames: u64, start: u64, scalar: Scalar) -> Self {
        let (order, fortran, frame_rate) = (Order::Points, None, None);
        Self { points, frames, start, scalar, order, fortran, frame_rate, first: 0.0, step: 1.0 }
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

    fn number(&self, frame: usize) -> f64 {
        self.first + self.step * frame as f64
    }

    fn read_next(&mut self, out: &mut Vec<f64>) -> Result<bool, Error> {
        if self.next == self.frames {
            out.clear();
            return Ok(false);
        }
        let in_order = self.order == Order::Points;
        let mut stored = if in_order { std::mem::take(out) } else { std::mem::take(&mut self.stored) };
        let finite = self.read_values(&mut stored).map_err(|cause| Error::read(&self.path, cause));
        *(if in_order { &mut *out } else { &mut self.stored }) = stored;
        let finite = finite?;
        if !in_order {
            self.arrange(out)?;
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
