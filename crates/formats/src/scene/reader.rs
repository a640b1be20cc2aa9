//! The frames of the meshes of a scene as a capture.

use std::ops::Range;
use std::path::{Path, PathBuf};

use cager_geometry::mesh::Polygons;
use cager_geometry::units::Units;

use crate::error::{Error, Fault};
use crate::frames::{FrameReader, PictureSequence, Times, named_in};

/// What all frames of a mesh have in common.
#[derive(Default)]
pub(crate) struct MeshInfo {
    pub(crate) points: usize,
    pub(crate) frames: usize,
    pub(crate) times: Times,
    pub(crate) faces: Polygons,
    pub(crate) units: Units,
    /// What the user should know of how it is read, beside its times.
    pub(crate) notes: Vec<String>,
    /// Frames in which each part is shown; `None` where it always is.
    pub(crate) shown: Vec<Option<Vec<Range<u32>>>>,
    /// Named from the folder of the file.
    pub(crate) pictures: Vec<PictureSequence>,
}

pub(crate) trait Animation: Send {
    fn info(&self) -> &MeshInfo;

    /// Reads a frame; gives whether all is finite.
    fn read(&mut self, frame: usize, out: &mut Vec<f64>) -> Result<bool, Fault>;
}

/// The frames of a mesh of so many points.
pub(crate) fn open<'a>(
    path: &Path,
    mesh: impl Animation + 'a,
    expected_points: usize,
) -> Result<Box<dyn FrameReader + 'a>, Error> {
    let path = path.to_owned();
    if mesh.info().points != expected_points {
        let found = mesh.info().points as u64;
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
        self.mesh.info().points
    }

    fn frames(&self) -> usize {
        self.mesh.info().frames
    }

    fn frame_rate(&self) -> Option<f64> {
        self.mesh.info().times.frame_rate
    }

    fn number(&self, frame: usize) -> f64 {
        self.mesh.info().times.number(frame)
    }

    fn numbers_are_times(&self) -> bool {
        self.mesh.info().times.numbers.is_some()
    }

    fn notes(&self) -> Vec<String> {
        let MeshInfo { times, notes, .. } = self.mesh.info();
        let all = times.note.iter().chain(notes);
        all.map(|note| format!("{}: {note}", self.path.display())).collect()
    }

    fn units(&self) -> Units {
        self.mesh.info().units
    }

    fn shown(&self) -> Vec<Option<Vec<Range<u32>>>> {
        self.mesh.info().shown.clone()
    }

    fn pictures(&self) -> Vec<PictureSequence> {
        let mut found = self.mesh.info().pictures.clone();
        let folder = self.path.parent().unwrap_or(Path::new(""));
        found.iter_mut().flat_map(|sequence| &mut sequence.paths).for_each(|path| *path = named_in(folder, path));
        found
    }

    fn mesh(&self) -> Option<(&Path, &Polygons)> {
        Some((&self.path, &self.mesh.info().faces))
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
