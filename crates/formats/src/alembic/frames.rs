//! The frames of one mesh of an archive.

use std::io::{Read, Seek};
use std::path::Path;

use cager_geometry::mesh::{Model, Polygons};

use super::choice::choose;
use super::mesh::Mesh;
use super::objects::Archive;
use super::ogawa::{Block, damaged};
use super::properties::Property;
use super::timing::timing;
use super::transform::{Chain, Moment};
use crate::error::{Error, Fault};
use crate::frames::{FrameReader, Times};
use crate::scene::{
    self, Animation, Faces, Failure, MOST_REPEATED, Matrix, check_held, determinant, placed, topology_changes,
};

/// Opens the frames of a mesh in an archive of `length` bytes; `prim` chooses one of several.
pub(crate) fn open_frames<'a>(
    path: &Path,
    source: impl Read + Seek + Send + 'a,
    length: u64,
    expected_points: usize,
    prim: Option<&str>,
) -> Result<Box<dyn FrameReader + 'a>, Error> {
    let mesh = MeshFrames::open(source, length, prim).map_err(|failure| failure.at(path))?;
    scene::open(path, mesh, expected_points)
}

/// The first frame of a mesh as a model, and how many of its faces were left out.
pub(crate) fn read_model(
    path: &Path,
    source: impl Read + Seek + Send,
    length: u64,
    prim: Option<&str>,
) -> Result<(Model, usize), Error> {
    let mesh = MeshFrames::open(source, length, prim).map_err(|failure| failure.at(path))?;
    let (left_out, points, mut values) = (mesh.faces.left_out, mesh.points, Vec::new());
    let mut reader = scene::open(path, mesh, points)?;
    reader.read_next(&mut values)?;
    let faces = reader.mesh().map(|(_, faces)| faces.clone()).unwrap_or_default();
    Ok((Model { points: values.as_chunks().0.to_vec(), faces, ..Model::default() }, left_out))
}

struct MeshFrames<R> {
    archive: Archive<R>,
    mesh: Mesh,
    chain: Chain,
    /// Whether the transforms turn the inside out.
    mirrored: bool,
    /// Those of the first frame, with which all others are compared.
    faces: Faces,
    /// Where faces are stored that are equal to these, the last ones first.
    equal: [[Block; 2]; 2],
    /// Index of the times of the frames.
    sampling: usize,
    times: Times,
    points: usize,
    frames: usize,
    block: Vec<u8>,
}

impl<R: Read + Seek> MeshFrames<R> {
    fn open(source: R, length: u64, prim: Option<&str>) -> Result<Self, Failure> {
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
        check_held(frames, first.length.saturating_mul(frames as u64) / 2 <= archive.container.length())?;
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
        let (faces, blocks) = mesh.faces(container, samples, points, mirrored)?;
        let (block, equal) = (Vec::new(), [blocks; 2]);
        Ok(Self { archive, mesh, chain, mirrored, faces, equal, sampling, times, points, frames, block })
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
        if points != self.points as u64 {
            let what = format!("it has {points} points, and {} in frame 0", self.points);
            return Err(topology_changes(&what).into());
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
        if self.equal.contains(&blocks) {
            return Ok(());
        }
        let (other, blocks) = self.mesh.faces(container, samples, self.points, self.mirrored)?;
        if other.polygons != self.faces.polygons {
            return Err(topology_changes("its faces are not those of frame 0").into());
        }
        self.equal = [blocks, self.equal[0]];
        Ok(())
    }
}

impl<R: Read + Seek + Send> Animation for MeshFrames<R> {
    fn points(&self) -> usize {
        self.points
    }

    fn frames(&self) -> usize {
        self.frames
    }

    fn times(&self) -> &Times {
        &self.times
    }

    fn faces(&self) -> &Polygons {
        &self.faces.polygons
    }

    fn read(&mut self, frame: usize, out: &mut Vec<f64>) -> Result<bool, Failure> {
        let (points, Block { start, .. }) = self.mesh.points(&mut self.archive.container, frame)?;
        self.check_faces(frame, points)?;
        let matrix = self.matrix(frame)?;
        // Every value is overwritten below.
        out.resize(3 * self.points, 0.0);
        let finite = self.archive.container.read_values(start, self.mesh.scalar, &mut self.block, out)?;
        Ok(placed(matrix.as_ref(), out, finite))
    }
}
