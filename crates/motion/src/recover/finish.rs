//! Frames whose cages are known: vertices that leave their cage, distances, positions written.

use super::RecoverError;
use super::colors::Painter;
use super::departures::{Departure, Departures};
use super::distances::{Looked, is_elsewhere};
use super::positions::RecoveredFrames;
use super::report::{FrameReport, How};
use super::source::SurfaceSource;
use super::surfaces::Followed;
use cager_formats::FrameReader;
use cager_geometry::mesh::{Point, TriMesh};
use cager_shape::registration::{SurfacePoint, sample_surface};
use cager_shape::tracking::OffsetSolver;

/// What is done with every frame in the end.
pub(super) struct Finisher<'a> {
    rest: &'a TriMesh,
    source: &'a dyn SurfaceSource,
    diagonal: f64,
    offsets: Option<OffsetSolver>,
    samples: Vec<SurfacePoint>,
    written: RecoveredFrames,
    painter: Painter,
    departures: Departures,
}

/// Frames that can be read, what left its surface in them, and colours where surfaces had some.
pub(super) struct Written {
    pub(super) frames: RecoveredFrames,
    pub(super) departures: Vec<Departure>,
    pub(super) colors: Option<Vec<[u8; 3]>>,
}

/// Points of the template that are measured to the surfaces.
const MEASURED: usize = 3000;

impl<'a> Finisher<'a> {
    /// For a template at rest; with offsets where vertices may leave the cage.
    pub(super) fn new(
        rest: &'a TriMesh,
        source: &'a dyn SurfaceSource,
        diagonal: f64,
        offsets: bool,
        written: RecoveredFrames,
    ) -> Self {
        let samples = sample_surface(&rest.vertices, &rest.triangles, MEASURED, 1);
        let offsets = offsets.then(|| OffsetSolver::new(rest, diagonal));
        let painter = Painter::new(rest.vertices.len(), diagonal);
        let departures = Departures::new(rest, &samples);
        Self { rest, source, diagonal, offsets, samples, written, painter, departures }
    }

    /// Writes a frame from where its cage has the template's points.
    pub(super) fn finish(
        &mut self,
        frame: usize,
        mut positions: Vec<Point>,
        how: How,
        followed: Option<&Followed>,
    ) -> Result<FrameReport, RecoverError> {
        if let (Some(offsets), Some(followed)) = (&self.offsets, followed) {
            positions = offsets.offset(&positions, &followed.target);
        }
        let seen = followed.map(|followed| &followed.seen);
        self.written.write(frame, &positions)?;
        if let Some(colored) = seen.and_then(|seen| seen.colored.as_ref()) {
            self.painter.add(&positions, colored);
        }
        let mesh = TriMesh { vertices: positions, triangles: self.rest.triangles.clone() };
        let points: Vec<Point> = self.samples.iter().map(|sample| sample.at(&mesh.vertices, &mesh.triangles)).collect();
        let looked = seen.map(|seen| Looked::at(&mesh, &points, seen, self.diagonal));
        let distances = looked.as_ref().map_or((None, None), |looked| looked.distances(self.diagonal));
        let elsewhere =
            seen.is_some_and(|seen| is_elsewhere(&points, &seen.observation.points, distances.1, self.diagonal));
        let how = if elsewhere { how.lost() } else { how };
        if let Some(looked) = looked.filter(|_| !elsewhere) {
            self.departures.look(frame, &mesh, &points, &looked, self.diagonal);
        }
        let named = (self.written.number(frame), self.source.file(frame));
        Ok(FrameReport::new(named, how, distances, seen))
    }

    /// All frames, ready to be read. `origin` was subtracted from them.
    pub(super) fn into_frames(mut self, origin: Option<Point>) -> Result<Written, RecoverError> {
        self.written.rewind()?;
        let numbers: Vec<f64> = (0..self.written.frames()).map(|frame| self.written.number(frame)).collect();
        let departures = self.departures.found(&numbers, origin);
        Ok(Written { frames: self.written, departures, colors: self.painter.colors(&self.rest.vertices) })
    }
}
