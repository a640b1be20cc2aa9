//! The frames of one mesh of an archive.

use std::collections::BTreeMap;
use std::io::{Read, Seek};
use std::path::Path;

use cager_geometry::mesh::{Model, Polygons};

use super::choice::choose;
use super::mesh::Mesh;
use super::objects::Archive;
use super::ogawa::{Block, damaged};
use super::properties::Property;
use super::sampling::Sampling;
use super::timing::timing;
use super::transform::Chain;
use super::unread;
use crate::dropped::Dropped;
use crate::error::{Error, Fault};
use crate::frames::{FrameReader, Times};
use crate::scene::{
    self, Animation, Faces, Failure, MOST_REPEATED, Matrix, check_held, determinant, placed, topology_changes,
};

/// Frames per second where an archive does not say them.
const USUAL_RATE: f64 = 24.0;

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
    dropped: &mut Dropped,
) -> Result<(Model, usize), Error> {
    let mut mesh = MeshFrames::open(source, length, prim).map_err(|failure| failure.at(path))?;
    mesh.archive.container.allow(4);
    // What cannot be named is no reason to refuse a mesh.
    unread::add(&mut mesh.archive, mesh.object, dropped).unwrap_or_default();
    let (left_out, points, mut values) = (mesh.faces.left_out, mesh.points, Vec::new());
    let mut reader = scene::open(path, mesh, points)?;
    reader.read_next(&mut values)?;
    let faces = reader.mesh().map(|(_, faces)| faces.clone()).unwrap_or_default();
    Ok((Model { points: values.as_chunks().0.to_vec(), faces, ..Model::default() }, left_out))
}

/// The times of all that moves, how many these are, and whether they are those of what has none.
fn moments<R: Read + Seek>(
    archive: &Archive<R>,
    mesh: &Mesh,
    chain: &Chain,
) -> Result<(Sampling, usize, bool), Failure> {
    let moving = Some(&mesh.positions).filter(|positions| !positions.is_constant());
    // Of each table of times as many as are used.
    let mut most: BTreeMap<usize, usize> = BTreeMap::new();
    for property in moving.into_iter().chain(chain.animated()) {
        let samples = most.entry(property.sampling).or_default();
        *samples = property.samples.max(*samples);
    }
    if most.is_empty() {
        most.insert(mesh.positions.sampling, mesh.positions.samples);
    }
    let all: Vec<(&Sampling, usize)> =
        most.iter().map(|(&sampling, &samples)| (&archive.samplings[sampling], samples)).collect();
    if let Some((_, frames)) = all.iter().find(|(sampling, samples)| !sampling.covers(*samples)) {
        return Err(damaged(&format!("it promises {frames} frames, of which not all can be there")).into());
    }
    if let [(sampling, frames)] = all.as_slice() {
        return Ok(((*sampling).clone(), *frames, most.contains_key(&0)));
    }
    let total = all.iter().fold(0_usize, |total, (_, samples)| total.saturating_add(*samples));
    check_held(total, (total as u64).saturating_mul(4) <= archive.container.length())?;
    let (sampling, frames) = Sampling::union(&all);
    Ok((sampling, frames, false))
}

/// A note of a transform that turns or travels far between two samples, where a scene shows it on its way.
fn sparse(sampling: &Sampling, frames: usize, told: Option<f64>) -> Option<String> {
    let gaps = (1..frames).map(|frame| sampling.time(frame) - sampling.time(frame - 1));
    let longest = gaps.fold(0.0, f64::max);
    let frame = 1.0 / told.unwrap_or(USUAL_RATE).min(USUAL_RATE);
    (longest > 1.01 * frame).then(|| {
        format!(
            "its transforms have samples up to {longest:.4} s apart, and the motion between them is not read; export it with a sample of each frame"
        )
    })
}

struct MeshFrames<R> {
    archive: Archive<R>,
    /// Index of the mesh among the objects.
    object: usize,
    mesh: Mesh,
    chain: Chain,
    /// Whether the transforms turn the inside out.
    mirrored: bool,
    /// Those of the first frame, with which all others are compared.
    faces: Faces,
    /// Where faces are stored that are equal to these, the last ones first.
    equal: [[Block; 2]; 2],
    /// The times of the frames.
    sampling: Sampling,
    times: Times,
    points: usize,
    frames: usize,
    block: Vec<u8>,
    /// The points of the next sample, where a frame lies between two.
    next: Vec<f64>,
    notes: Vec<String>,
}

impl<R: Read + Seek> MeshFrames<R> {
    fn open(source: R, length: u64, prim: Option<&str>) -> Result<Self, Failure> {
        let mut archive = Archive::open(source, length)?;
        let object = choose(&mut archive, prim)?;
        archive.container.allow(4);
        let mesh = Mesh::open(&mut archive, object)?;
        let chain = Chain::of(&mut archive, object)?;
        let (sampling, frames, is_default) = moments(&archive, &mesh, &chain)?;
        let (points, first) = mesh.points(&mut archive.container, 0)?;
        let points = usize::try_from(points).unwrap_or(usize::MAX);
        if points == 0 {
            return Err(
                Fault::invalid("has a mesh without points in its first frame; export it with its points").into()
            );
        }
        check_held(frames, first.length.saturating_mul(frames as u64) / 2 <= archive.container.length())?;
        let times = timing(&sampling, frames, archive.frame_rate, is_default)?;
        let sparse = chain.animated().next().and_then(|_| sparse(&sampling, frames, archive.frame_rate));
        let notes = sparse.into_iter().chain(unread::visibility(&mut archive, object).unwrap_or_default()).collect();
        let Archive { container, samplings, .. } = &mut archive;
        let mut mirrored = false;
        // What is not there yet is often scaled to nothing.
        for frame in 0..frames.min(MOST_REPEATED) {
            let scale = chain.matrix(container, samplings, sampling.time(frame))?.as_ref().map_or(1.0, determinant);
            mirrored = scale < 0.0;
            if scale != 0.0 {
                break;
            }
        }
        let samples = [&mesh.indices, &mesh.counts].map(|faces| faces.find(sampling.time(0), samplings).0);
        let (faces, blocks) = mesh.faces(container, samples, points, mirrored)?;
        let (block, next, equal) = (Vec::new(), Vec::new(), [blocks; 2]);
        Ok(Self {
            archive,
            object,
            mesh,
            chain,
            mirrored,
            faces,
            equal,
            sampling,
            times,
            points,
            frames,
            block,
            next,
            notes,
        })
    }

    fn matrix(&mut self, frame: usize) -> Result<Option<Matrix>, Failure> {
        self.chain.matrix(&mut self.archive.container, &self.archive.samplings, self.sampling.time(frame))
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
        let seconds = self.sampling.time(frame);
        let sample = |faces: &Property| faces.find(seconds, &self.archive.samplings).0;
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

    fn notes(&self) -> &[String] {
        &self.notes
    }

    fn read(&mut self, frame: usize, out: &mut Vec<f64>) -> Result<bool, Failure> {
        let (sample, share) = self.mesh.positions.find(self.sampling.time(frame), &self.archive.samplings);
        let (points, Block { start, .. }) = self.mesh.points(&mut self.archive.container, sample)?;
        self.check_faces(frame, points)?;
        let matrix = self.matrix(frame)?;
        // Every value is overwritten below.
        out.resize(3 * self.points, 0.0);
        let mut finite = self.archive.container.read_values(start, self.mesh.scalar, &mut self.block, out)?;
        if share > 0.0 {
            let (following, Block { start, .. }) = self.mesh.points(&mut self.archive.container, sample + 1)?;
            // Where the number of points changes, those before hold.
            if following == points {
                self.next.resize(out.len(), 0.0);
                let (scalar, next) = (self.mesh.scalar, &mut self.next);
                finite &= self.archive.container.read_values(start, scalar, &mut self.block, next)?;
                out.iter_mut().zip(next).for_each(|(value, next)| *value += share * (*next - *value));
                finite &= out.iter().all(|x| x.is_finite());
            }
        }
        Ok(placed(matrix.as_ref(), out, finite))
    }
}
