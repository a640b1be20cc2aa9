//! Point caches: a header, then the coordinates of all frames as one array.

use std::io::{self, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

use super::block::read_values;
use super::fortran::Transposed;
use super::layout::{LONGEST_HEADER, Layout, Order};
use super::times::Times;
use super::widen::Scalar;
use super::{CacheFormat, FrameReader, FrameSelection, maya, mdd, npy, pc2};
use crate::alembic;
use crate::error::{Error, Fault};
use crate::glb;
use crate::scene::{self, MovingMesh};
use crate::signature::Signature;
use crate::usd;

/// Opens a cache: reads the header and compares its promise with `length`, the bytes there are, and with the points that are expected. Of a scene
/// what is selected is read, and from `folder` what it has in other files.
pub(super) fn open<'a>(
    format: CacheFormat,
    path: &Path,
    mut source: impl Read + Seek + Send + 'a,
    length: u64,
    expected_points: usize,
    selection: &FrameSelection,
    folder: Option<&Path>,
) -> Result<Box<dyn FrameReader + 'a>, Error> {
    let prim = selection.prim.as_deref();
    let read = |cause| Error::read(path, cause);
    let mut head = Vec::new();
    source.by_ref().take(LONGEST_HEADER as u64).read_to_end(&mut head).map_err(read)?;
    if let Some(what) = Signature::other_than(format.extension(), &head) {
        return Err(Fault::damaged(what).at(path));
    }
    let place = npy::Place { name: None };
    let layout = match format {
        CacheFormat::Npy => npy::layout(&head, expected_points as u64, place),
        CacheFormat::Pc2 => pc2::layout(&head),
        CacheFormat::Mdd => mdd::layout(&head),
        CacheFormat::Mcx | CacheFormat::Mc => return maya::open(path, source, length, expected_points, (prim, folder)),
        CacheFormat::Usdc | CacheFormat::Usdz | CacheFormat::Usda | CacheFormat::Usd => {
            return open_scene(path, usd::open(source, length, prim, None), expected_points);
        }
        CacheFormat::Glb | CacheFormat::Gltf => {
            let kind = glb::Source { is_text: format == CacheFormat::Gltf, folder };
            return glb::open_frames(path, (source, length), &kind, expected_points, selection);
        }
        CacheFormat::Abc => return open_scene(path, alembic::open(source, length, prim, None), expected_points),
    };
    let mut layout = layout.map_err(|fault| fault.at(path))?;
    if format == CacheFormat::Mdd && layout.check(length, expected_points, path).is_ok() {
        // No more than the file holds, as its length is right.
        let mut times = vec![0; 4 * layout.frames as usize];
        source.seek(SeekFrom::Start(mdd::HEADER)).and_then(|_| source.read_exact(&mut times)).map_err(read)?;
        layout.times = mdd::times(&times).map_err(|fault| fault.at(path))?;
    }
    open_layout(path, source, layout, length, expected_points)
}

fn open_scene<'a>(
    path: &Path,
    opened: Result<MovingMesh<'a>, Fault>,
    expected_points: usize,
) -> Result<Box<dyn FrameReader + 'a>, Error> {
    scene::open(path, opened.map_err(|failure| failure.at(path))?, expected_points)
}

/// Opens a cache of `length` bytes whose header was read.
pub(super) fn open_layout<'a>(
    path: &Path,
    source: impl Read + Seek + Send + 'a,
    mut layout: Layout,
    length: u64,
    expected_points: usize,
) -> Result<Box<dyn FrameReader + 'a>, Error> {
    layout.check(length, expected_points, path)?;
    let Some(rows) = layout.fortran.take() else {
        return Ok(Box::new(CacheReader::new(path, source, layout, expected_points)));
    };
    // All of these are factors of the file's length.
    let (size, frames, rows) = (layout.scalar.size(), layout.frames as usize, rows as usize);
    let columns = layout.order.values() * expected_points / rows;
    let gathered = Transposed::new(source, layout.start, size, [frames, rows, columns]);
    layout.start = 0;
    Ok(Box::new(CacheReader::new(path, gathered, layout, expected_points)))
}

struct CacheReader<R> {
    path: PathBuf,
    source: R,
    start: u64,
    scalar: Scalar,
    order: Order,
    times: Times,
    points: usize,
    frames: usize,
    next: usize,
    block: Vec<u8>,
    /// A frame in an order of its own.
    stored: Vec<f64>,
}

impl<R: Read + Seek> CacheReader<R> {
    fn new(path: &Path, source: R, layout: Layout, points: usize) -> Self {
        Self {
            path: path.to_owned(),
            source,
            start: layout.start,
            scalar: layout.scalar,
            order: layout.order,
            times: layout.times,
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
        // Fits, as the end of the last frame is the size of the file.
        let offset = self.start + (self.next * out.len() * size) as u64;
        read_values(&mut self.source, offset, self.scalar, &mut self.block, out)
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

impl<R: Read + Seek + Send> FrameReader for CacheReader<R> {
    fn points(&self) -> usize {
        self.points
    }

    fn frames(&self) -> usize {
        self.frames
    }

    fn frame_rate(&self) -> Option<f64> {
        self.times.frame_rate
    }

    fn number(&self, frame: usize) -> f64 {
        self.times.number(frame)
    }

    fn numbers_are_times(&self) -> bool {
        self.times.numbers.is_some()
    }

    fn notes(&self) -> Vec<String> {
        self.times.note.iter().map(|note| format!("{}: {note}", self.path.display())).collect()
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
