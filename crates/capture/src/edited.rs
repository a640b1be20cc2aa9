//! Reading cages that were edited in another program.

use crate::decode::opened::{Container, DecodeError};
use crate::decode::units;
use crate::origin::move_to;
use cager_formats::{Error, FrameRange, FrameReader, open_frames};
use cager_geometry::mesh::Point;
use cager_geometry::units::{Change, Units};
use cager_proto::container::LayerBuilder;
use std::path::{Path, PathBuf};

/// Opens the frames of edited cages from the first.
type Reopen = dyn Fn() -> Result<Box<dyn FrameReader>, Error> + Send;

/// Edited cages of a container, frame by frame in any order.
pub struct EditedCages {
    path: PathBuf,
    vertices: usize,
    /// Frames of the container.
    own_frames: usize,
    /// Why they cannot take the place of all its frames, if they cannot.
    incomplete: Option<String>,
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
    /// What this file may have rounded coordinates of the last frame by.
    slack: Vec<f64>,
}

impl EditedCages {
    /// Opens frames of the cage in `container`, in any format that captures come in; there may be
    /// more or fewer of them than the container has.
    ///
    /// # Errors
    /// Frames that cannot be read or have another number of vertices; cages with normals of their
    /// own, which no file of positions holds.
    pub fn open(path: &Path, container: &Container) -> Result<Self, DecodeError> {
        let (file, vertices) = (path.to_owned(), container.header().cage_vertices as usize);
        Self::of_frames(path, container, Box::new(move || open_frames(&file, vertices)))
    }

    /// The same of frames that `reopen` gives from the first; errors name `path`.
    ///
    /// # Errors
    /// As [`Self::open`].
    pub fn of_frames(path: &Path, container: &Container, reopen: Box<Reopen>) -> Result<Self, DecodeError> {
        let header = container.header();
        let incomplete = (u64::from(header.rows_per_frame) != header.cage_vertices).then(|| {
            format!(
                "edited cages have no normals, which {} coordinates keep for every face beside the vertices, so there must be one for each of the {} frames; add or leave out none, or encode the capture with green or mvc coordinates",
                header.coordinates,
                container.frames()
            )
        });
        let vertices = header.cage_vertices as usize;
        let reader = reopen().map_err(|error| named(error, vertices, header.points))?;
        let (points, origin) = (header.points, header.origin);
        let change = reader.units().change_to(header.units);
        Ok(Self {
            path: path.to_owned(),
            vertices,
            own_frames: container.frames(),
            incomplete,
            points,
            origin,
            change,
            reader,
            reopen,
            next: 0,
            wide: Vec::new(),
            slack: Vec::new(),
        })
    }

    /// Lets positions be in these units where the file does not say it, and changes them to the
    /// container's.
    ///
    /// # Errors
    /// A unit or an axis is given, and the container does not know its own.
    pub fn meaning(mut self, given: Units, container: &Container, input: &Path) -> Result<Self, DecodeError> {
        let own = container.header().units;
        units::check(own, given, input)?;
        self.change = self.reader.units().or(given).change_to(own);
        Ok(self)
    }

    /// Number of frames.
    pub fn frames(&self) -> usize {
        self.reader.frames()
    }

    /// Whether they take the place of all frames, since there is not one for each of them or of a
    /// range.
    pub fn replaces_frames(&self, range: Option<FrameRange>) -> bool {
        range.is_none() && self.frames() != self.own_frames
    }

    /// Which edited cage is of which frame of the container.
    pub(crate) fn places(&self, range: Option<FrameRange>) -> Result<Vec<(usize, usize)>, DecodeError> {
        let Some(range) = range else { return Ok((0..self.own_frames).map(|frame| (frame, frame)).collect()) };
        range.check(self.own_frames, |frame| frame as f64, &self.path)?;
        let frames = (0..range.count()).map(|place| range.frame(place));
        match self.frames() {
            all if all == self.own_frames => Ok(frames.map(|frame| (frame, frame)).collect()),
            some if some == range.count() => Ok(frames.enumerate().collect()),
            other => Err(self.fail(format!(
                "has {other} frames, where {} are edited of {}; give as many, or all",
                range.count(),
                self.own_frames
            ))),
        }
    }

    /// Reads the cage of a frame beside the one that it was made from: coordinates are those of
    /// `old`, which may have more rows, where they differ by no more than this file rounds them by.
    pub(crate) fn read_beside(&mut self, frame: usize, old: &[f32], out: &mut Vec<f32>) -> Result<(), DecodeError> {
        self.read(frame, out)?;
        for ((new, &old), slack) in out.iter_mut().zip(old).zip(&self.slack) {
            if (f64::from(*new) - f64::from(old)).abs() <= *slack {
                *new = old;
            }
        }
        Ok(())
    }

    /// Makes the edited cage of a frame of the container's own, as a layer does.
    pub(crate) fn move_frame(&mut self, frame: usize, cage: &mut [f32]) -> Result<(), DecodeError> {
        let mut new = Vec::with_capacity(3 * self.vertices);
        self.read_beside(frame, cage, &mut new)?;
        let mut builder = LayerBuilder::default();
        builder.add(frame, cage, &new);
        if let Some(layer) = builder.finish("") {
            layer.apply(frame, cage);
        }
        Ok(())
    }

    /// Reads the cage of a frame in place of the container's, vertices × 3; fastest in ascending
    /// order.
    ///
    /// # Errors
    /// Damage, another number of vertices, and coordinates beyond single precision.
    pub fn read_frame(&mut self, frame: usize, out: &mut Vec<f32>) -> Result<(), DecodeError> {
        match &self.incomplete {
            Some(what) => Err(self.fail(what.clone())),
            None => self.read(frame, out),
        }
    }

    fn read(&mut self, frame: usize, out: &mut Vec<f32>) -> Result<(), DecodeError> {
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
        // What the file can hold: single precision, or so many decimals.
        let is_single = self.wide.iter().all(|&x| f64::from(x as f32).to_bits() == x.to_bits());
        let decimals = (3..8).find(|&k| self.wide.iter().all(|&x| (x * 10f64.powi(k)).round() / 10f64.powi(k) == x));
        let points = self.wide.as_chunks_mut().0;
        self.change.apply_to(points);
        self.slack.clear();
        let rounded = decimals.filter(|_| !is_single).map_or(0.0, |decimals| 0.5 * 10f64.powi(-decimals));
        let slack = |&x: &f64| match (is_single, decimals) {
            (false, None) => 0.0,
            _ => self.change.scale.abs() * rounded + 2.0 * f64::from(f32::EPSILON) * x.abs(),
        };
        self.slack.extend(points.as_flattened().iter().map(slack));
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
