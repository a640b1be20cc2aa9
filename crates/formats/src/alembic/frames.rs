//! The frames of one mesh of an archive.

use std::io::{Read, Seek};
use std::path::{Path, PathBuf};

use cager_geometry::mesh::{Model, Polygons};

use super::choice::choose;
use super::mesh::{Faces, Mesh};
use super::objects::Archive;
use super::ogawa::{Block, Failure, damaged};
use super::properties::Property;
use super::timing::timing;
use super::transform::{Chain, Matrix, Moment, apply, determinant};
use crate::error::{Error, Fault};
use crate::frames::{FrameReader, Times, widen};

/// Bytes read at once: few calls, and still within the fast caches.
const BLOCK: usize = 1 << 17;
/// Frames that an archive may have however few of them it holds: repetitions take no room, nor do the points of what a transform moves. Of more it
/// holds every other one.
const MOST_REPEATED: usize = 1 << 14;

/// Opens the frames of a mesh in an archive of `length` bytes; `prim` chooses one of several.
pub(crate) fn open_frames<'a>(
    path: &Path,
    source: impl Read + Seek + Send + 'a,
    length: u64,
    expected_points: usize,
    prim: Option<&str>,
) -> Result<Box<dyn FrameReader + 'a>, Error> {
    let reader = MeshFrames::open(path, source, length, prim).map_err(|failure| failure.at(path))?;
    if reader.points != expected_points {
        let (path, found) = (path.to_owned(), reader.points as u64);
        return Err(Error::PointCount { path, frame: None, expected: expected_points, found });
    }
    Ok(Box::new(reader))
}

/// The first frame of a mesh as a model, and how many of its faces were left out.
pub(crate) fn read_model(
    path: &Path,
    source: impl Read + Seek + Send,
    length: u64,
    prim: Option<&str>,
) -> Result<(Model, usize), Error> {
    let mut reader = MeshFrames::open(path, source, length, prim).map_err(|failure| failure.at(path))?;
    let mut values = Vec::new();
    reader.read_next(&mut values)?;
    let model = Model { points: values.as_chunks().0.to_vec(), faces: reader.faces.polygons, ..Model::default() };
    Ok((model, reader.faces.left_out))
}

struct MeshFrames<R> {
    path: PathBuf,
    archive: Archive<R>,
    mesh: Mesh,
    chain: Chain,
    /// Whether the transforms turn the inside out.
    mirrored: bool,
    /// Those of the first frame, with which all others are compared; where the last ones are stored that were equal.
    faces: Faces,
    /// Where those are stored that were equal before these.
    equal: [Block; 2],
    /// Index of the times of the frames.
    sampling: usize,
    times: Times,
    points: usize,
    frames: usize,
    next: usize,
    block: Vec<u8>,
}

impl<R: Read + Seek> MeshFrames<R> {
    fn open(path: &Path, source: R, length: u64, prim: Option<&str>) -> Result<Self, Failure> {
        let mut archive = Archive::open(source, length)?;
        let object = choose(&mut archive, prim)?;
        archive.container.allow(4);
        let mesh = Mesh::open(&mut archive, object)?;
        let chain = Chain::of(&mut archive, object)?;
        // What moves tells the frames: the points, or else a transform.
        let moving = Some(&mesh.positions).filter(|positions| !positions.is_constant());
        let driver = moving.or_else(|| chain.animated()).unwrap_or(&mesh.positions);
        let (frames, sampling) = (driver.samples, driver.sampling);
        if !archive.samplings[sampling].covers(frames) {
            return Err(damaged(&format!("it promises {frames} frames, of which not all can be there")).into());
        }
        let (points, first) = mesh.points(&mut archive.container, 0)?;
        let points = usize::try_from(points).unwrap_or(usize::MAX);
        if points == 0 {
            return Err(
                Fault::invalid("has a mesh without points in its first frame; export it with its points").into()
            );
        }
        if frames > MOST_REPEATED && first.length.saturating_mul(frames as u64) / 2 > archive.container.length() {
            let what = format!(
                "promises {frames} frames, of which it holds fewer than half; export {MOST_REPEATED} frames at the most, or all of them as positions"
            );
            return Err(Fault::unsupported(what).into());
        }
        let times = timing(&archive.samplings[sampling], frames, archive.frame_rate, sampling == 0)?;
        let Archive { container, samplings, .. } = &mut archive;
        let moment = |sample| Moment { sample, sampling, seconds: samplings[sampling].time(sample) };
        let mut mirrored = false;
        // What is not there yet is often scaled to nothing.
        for frame in 0..frames.min(MOST_REPEATED) {
            let scale = chain.matrix(container, samplings, moment(frame))?.as_ref().map_or(1.0, determinant);
            mirrored = scale < 0.0;
            if scale != 0.0 {
                break;
            }
        }
        let samples = [&mesh.indices, &mesh.counts].map(|faces| moment(0).of(faces, samplings).0);
        let faces = mesh.faces(container, samples, points, mirrored)?;
        let (path, block, equal) = (path.to_owned(), Vec::new(), faces.blocks);
        Ok(Self { path, archive, mesh, chain, mirrored, faces, equal, sampling, times, points, frames, next: 0, block })
    }

    fn moment(&self, frame: usize) -> Moment {
        let seconds = self.archive.samplings[self.sampling].time(frame);
        Moment { sample: frame, sampling: self.sampling, seconds }
    }

    fn matrix(&mut self, frame: usize) -> Result<Option<Matrix>, Failure> {
        let moment = self.moment(frame);
        self.chain.matrix(&mut self.archive.container, &self.archive.samplings, moment)
    }

    /// Refuses a frame whose faces are others than those of the first.
    fn check_faces(&mut self, frame: usize, points: u64) -> Result<(), Failure> {
        let changed = |what: &str| {
            Fault::unsupported(format!(
                "its topology changes: {what}; export a mesh that keeps its points and faces, or only the frames before"
            ))
        };
        if points != self.points as u64 {
            return Err(changed(&format!("it has {points} points, and {} in frame 0", self.points)).into());
        }
        if self.mesh.indices.is_constant() && self.mesh.counts.is_constant() {
            return Ok(());
        }
        let moment = self.moment(frame);
        let sample = |faces: &Property| moment.of(faces, &self.archive.samplings).0;
        let samples = [sample(&self.mesh.indices), sample(&self.mesh.counts)];
        let container = &mut self.archive.container;
        let blocks =
            [self.mesh.indices.sample(container, samples[0])?, self.mesh.counts.sample(container, samples[1])?];
        if blocks == self.faces.blocks || blocks == self.equal {
            return Ok(());
        }
        let other = self.mesh.faces(container, samples, self.points, self.mirrored)?;
        if other.polygons != self.faces.polygons {
            return Err(changed("its faces are not those of frame 0").into());
        }
        self.equal = std::mem::replace(&mut self.faces.blocks, other.blocks);
        Ok(())
    }

    /// Reads a frame; gives whether all is finite.
    fn read(&mut self, frame: usize, out: &mut Vec<f64>) -> Result<bool, Failure> {
        let (points, Block { start, .. }) = self.mesh.points(&mut self.archive.container, frame)?;
        self.check_faces(frame, points)?;
        let matrix = self.matrix(frame)?;
        let size = self.mesh.scalar.size();
        // Every value is overwritten below.
        out.resize(3 * self.points, 0.0);
        self.block.resize(BLOCK.min(out.len() * size), 0);
        let (mut finite, mut at) = (true, start);
        for values in out.chunks_mut(BLOCK / size) {
            let bytes = &mut self.block[..values.len() * size];
            self.archive.container.read(at, bytes)?;
            at += bytes.len() as u64;
            finite &= widen(self.mesh.scalar, bytes, values);
        }
        if let Some(matrix) = matrix {
            apply(&matrix, out);
            finite &= out.iter().all(|x| x.is_finite());
        }
        Ok(finite)
    }
}

impl<R: Read + Seek + Send> FrameReader for MeshFrames<R> {
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

    fn mesh(&self) -> Option<(&Path, &Polygons)> {
        Some((&self.path, &self.faces.polygons))
    }

    fn read_next(&mut self, out: &mut Vec<f64>) -> Result<bool, Error> {
        let frame = self.next;
        if frame == self.frames {
            out.clear();
            return Ok(false);
        }
        match self.read(frame, out) {
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
        let more = self.next < self.frames;
        self.next += usize::from(more);
        Ok(more)
    }
}
