//! Reading cages that were edited in another program.

use crate::decode::opened::{Container, DecodeError};
use crate::origin::move_to;
use cager_formats::{Error, FrameReader, open_frames};
use cager_geometry::mesh::Point;
use cager_geometry::units::Change;
use std::path::{Path, PathBuf};

/// Opens the frames of edited cages from the first.
type Reopen = dyn Fn() -> Result<Box<dyn FrameReader>, Error> + Send;

/// Edited cages of a container, frame by frame in any order.
pub struct EditedCages {
    path: PathBuf,
    vertices: usize,
    /// Points of the model.
    points: u64,
    origin: Option<Point>,
    /// What makes positions those of the container, where both say what theirs mean.
    change: Change,
    reader: Box<dyn FrameReader>,
    reopen: Box<Reopen>,
    /// The frame that the reader gives next.
    next: usize,
    wide: Vec<f64>,
}

impl EditedCages {
    /// Opens frames of the cage in `container`, in any format that captures come in; there may be more or fewer of them than
    /// the container has.
    ///
    /// # Errors
    /// Frames that cannot be read or have another number of vertices; cages with normals of their own, which no file of
    /// positions holds.
    pub fn open(path: &Path, container: &Container) -> Result<Self, DecodeError> {
        let (file, vertices) = (path.to_owned(), container.header().rows_per_frame as usize);
        Self::of_frames(path, container, Box::new(move || open_frames(&file, vertices)))
    }

    /// The same of frames that `reopen` gives from the first; errors name `path`.
    ///
    /// # Errors
    /// As [`Self::open`].
    pub fn of_frames(path: &Path, container: &Container, reopen: Box<Reopen>) -> Result<Self, DecodeError> {
        let header = container.header();
        let fail = |what: String| DecodeError::Edited { path: path.to_owned(), what };
        if u64::from(header.rows_per_frame) != header.cage_vertices {
            return Err(fail(format!(
                "edited cages have no normals, which {} coordinates keep for every face beside the vertices; encode the capture with --coordinates green or mvc to edit its cages",
                header.coordinates
            )));
        }
        let vertices = header.rows_per_frame as usize;
        let reader = reopen().map_err(|error| named(error, vertices, header.points))?;
        let (points, origin) = (header.points, header.origin);
        let change = reader.units().change_to(header.units);
        Ok(Self { path: path.to_owned(), vertices, points, origin, change, reader, reopen, next: 0, wide: Vec::new() })
    }

    /// Number of frames.
    pub fn frames(&self) -> usize {
        self.reader.frames()
    }

    /// Reads the cage of a frame, vertices × 3. Reading in ascending order is fastest.
    ///
    /// # Errors
    /// Damage, another number of vertices, and coordinates beyond single precision.
    pub fn read_frame(&mut self, frame: usize, out: &mut Vec<f32>) -> Result<(), DecodeError> {
        if frame < self.next {
            self.reader = (self.reopen)()?;
            self.next = 0;
        }
        while self.next < frame && self.reader.skip()? {
            self.next += 1;
        }
        let (vertices, points) = (self.vertices, self.points);
        let more = self.reader.read_next(&mut self.wide).map_err(|error| named(error, vertices, points))?;
        if !more {
            return Err(self.fail(format!("ends before frame {frame}, though it has announced more; export it again")));
        }
        self.next += 1;
        out.clear();
        let points = self.wide.as_chunks_mut().0;
        self.change.apply_to(points);
        move_to(self.origin, points);
        out.extend(self.wide.iter().map(|&x| x as f32));
        match out.iter().position(|x| x.is_nan() || x.abs() > FARTHEST) {
            Some(k) => Err(self.fail(format!(
                "frame {frame}: vertex {} of the cage is too far away for single precision, in which cages are kept; move it closer",
                k / 3
            ))),
            None => Ok(()),
        }
    }

    fn fail(&self, what: String) -> DecodeError {
        DecodeError::Edited { path: self.path.clone(), what }
    }
}

/// Coordinates of cages whose decoded positions are sure to be finite, at the most.
const FARTHEST: f32 = 1e-4 * f32::MAX;

/// Rewrites a point-count error in terms of the cage.
fn named(error: Error, vertices: usize, points: u64) -> DecodeError {
    let Error::PointCount { path, frame, found, .. } = error else { return error.into() };
    let place = frame.map_or_else(String::new, |frame| format!("frame {frame} "));
    let cure = if found == points {
        "these are frames of the model, not of its cage"
    } else {
        "edit the cages that `cager decode --cages` writes, and neither add nor remove vertices"
    };
    DecodeError::Edited {
        path,
        what: format!("{place}has {found} points where the cage has {vertices} vertices; {cure}"),
    }
}
