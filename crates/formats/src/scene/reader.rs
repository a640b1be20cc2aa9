//! The frames of one mesh of a scene.

use std::path::{Path, PathBuf};

use cager_geometry::mesh::Polygons;
use cager_geometry::units::Units;

use super::failure::Failure;
use crate::error::Error;
use crate::frames::{FrameReader, Times};

/// A mesh that moves.
pub(crate) trait Animation: Send {
    /// How many points it has in its first frame.
    fn points(&self) -> usize;

    fn frames(&self) -> usize;

    fn times(&self) -> &Times;

    /// The faces of all frames.
    fn faces(&self) -> &Polygons;

    fn units(&self) -> Units {
        Units::UNKNOWN
    }

    /// What the user should know of how it is read, beside its times.
    fn notes(&self) -> &[String] {
        &[]
    }

    /// Reads a frame; gives whether all is finite.
    fn read(&mut self, frame: usize, out: &mut Vec<f64>) -> Result<bool, Failure>;
}

/// The frames of a mesh of so many points.
pub(crate) fn open<'a>(
    path: &Path,
    mesh: impl Animation + 'a,
    expected_points: usize,
) -> Result<Box<dyn FrameReader + 'a>, Error> {
    let path = path.to_owned();
    if mesh.points() != expected_points {
        let found = mesh.points() as u64;
        return Err(Error::PointCount { path, frame: None, expected: expected_points, found });
    }
    Ok(Box::new(Reader { path, mesh, next: 0 }))
}

struct Reader<A> {
    path: PathBuf,
    mesh: A,
    next: usize,
}

impl<A: Animation> FrameReader for Reader<A> {
    fn points(&self) -> usize {
        self.mesh.points()
    }

    fn frames(&self) -> usize {
        self.mesh.frames()
    }

    fn frame_rate(&self) -> Option<f64> {
        self.mesh.times().frame_rate
    }

    fn number(&self, frame: usize) -> f64 {
        self.mesh.times().number(frame)
    }

    fn numbers_are_times(&self) -> bool {
        self.mesh.times().numbers.is_some()
    }

    fn notes(&self) -> Vec<String> {
        let all = self.mesh.times().note.iter().chain(self.mesh.notes());
        all.map(|note| format!("{}: {note}", self.path.display())).collect()
    }

    fn units(&self) -> Units {
        self.mesh.units()
    }

    fn mesh(&self) -> Option<(&Path, &Polygons)> {
        Some((&self.path, self.mesh.faces()))
    }

    fn read_next(&mut self, out: &mut Vec<f64>) -> Result<bool, Error> {
        let frame = self.next;
        if frame == self.frames() {
            out.clear();
            return Ok(false);
        }
        match self.mesh.read(frame, out) {
            Err(failure) => {
                out.clear();
                Err(failure.at(&self.path).in_frame(frame))
            }
            Ok(false) => {
                let culprit = out.iter().position(|x| !x.is_finite()).unwrap_or(0);
                Err(Error::NonFinite { path: self.path.clone(), frame, point: culprit / 3 })
            }
            Ok(true) => {
                self.next += 1;
                Ok(true)
            }
        }
    }

    fn skip(&mut self) -> Result<bool, Error> {
        let more = self.next < self.frames();
        self.next += usize::from(more);
        Ok(more)
    }
}
