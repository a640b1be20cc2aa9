//! One mesh of a scene, whatever file it is in: its points and faces at any time.

use std::sync::Arc;

use cager_geometry::mesh::Polygons;
use cager_geometry::surface::Part;

use super::deform::Deformer;
use super::faces::{faces, most_corners, topology_changes};
use super::shown::Steps;
use super::surface::arranged;
use super::track::{MOST_REPEATED, Track, Value, Values};
use super::transform::{Chain, place};
use crate::error::Fault;

/// What a parser finds of a mesh.
#[derive(Default)]
pub(crate) struct MeshTracks {
    pub(crate) positions: Track,
    /// How many corners faces have, and which.
    pub(crate) faces: [Track; 2],
    pub(crate) is_clockwise: bool,
    /// Whether the deformer shows them as a mirror does.
    pub(crate) is_mirrored: bool,
    /// What moves them before the transforms above do.
    pub(crate) deformer: Option<Box<dyn Deformer>>,
    pub(crate) chain: Chain,
    pub(crate) shown: Arc<Steps>,
    /// The path; where a model is read, what lies on the faces too, of all faces and their corners
    /// in the order of the file. Numbers of points and faces are not looked at.
    pub(crate) part: Part,
    /// Of each corner in the first sample of the positions; empty where there are none.
    pub(crate) normals: Vec<[f32; 3]>,
}

pub(super) struct MovingMesh {
    tracks: MeshTracks,
    /// Whether faces are turned around as they are read.
    turned: bool,
    /// Where faces are stored that are equal to these, the last ones first.
    equal: [[Option<Value>; 2]; 2],
    pub(super) points: usize,
    pub(super) faces: Polygons,
    /// Faces of fewer than three corners.
    pub(super) left_out: usize,
    /// The points of the next sample, where a frame lies between two.
    next: Vec<f64>,
}

/// The smallest and the largest coordinates of points, `x y z x y z …`.
pub(crate) fn bounds(positions: &[f32]) -> [[f32; 3]; 2] {
    positions.as_chunks().0.iter().fold(
        [[f32::INFINITY; 3], [f32::NEG_INFINITY; 3]],
        |[low, high], point: &[f32; 3]| {
            [std::array::from_fn(|k| low[k].min(point[k])), std::array::from_fn(|k| high[k].max(point[k]))]
        },
    )
}

impl MovingMesh {
    /// At the times of frames; none where it has no points in the first.
    pub(super) fn new(source: &mut dyn Values, tracks: MeshTracks, at: &[f64]) -> Result<Option<Self>, Fault> {
        let points = match tracks.positions.at(at[0]) {
            Some((first, ..)) => source.points(first)?.count,
            None => 0,
        };
        if points == 0 {
            return Ok(None);
        }
        let mut mirrored = tracks.is_mirrored;
        // What is not there yet is often scaled to nothing.
        for &time in at.iter().take(MOST_REPEATED) {
            let scale = tracks.chain.matrix(source, time)?.map_or(1.0, |matrix| matrix.matrix3.determinant());
            if scale != 0.0 {
                mirrored ^= scale < 0.0;
                break;
            }
        }
        let turned = tracks.is_clockwise ^ mirrored;
        let (faces, next) = (Polygons::new(), Vec::new());
        let mut mesh = Self { tracks, turned, equal: [[None; 2]; 2], points, faces, left_out: 0, next };
        let places = mesh.places(at[0]);
        let arities = mesh.arities(source, places)?;
        (mesh.faces, mesh.left_out) = mesh.read_faces(source, places)?;
        mesh.equal = [places; 2];
        let (part, normals) = (std::mem::take(&mut mesh.tracks.part), std::mem::take(&mut mesh.tracks.normals));
        let (part, normals) = arranged(part, &normals, &arities, turned);
        mesh.tracks.part = Part { points, faces: mesh.faces.len(), ..part };
        mesh.take_normals(source, normals, mirrored);
        Ok(Some(mesh))
    }

    /// Takes the normals of the corners of its faces, which are those of its first positions before anything moves them.
    /// What cannot be read of these is no reason to refuse a mesh.
    fn take_normals(&mut self, source: &mut dyn Values, mut normals: Vec<[f32; 3]>, mirrored: bool) {
        let positions = &self.tracks.positions;
        let Some(first) = positions.values.first().copied().or(positions.default) else { return };
        let Ok(stored) = source.points(first) else { return };
        let mut places = vec![0.0; 3 * self.points];
        if normals.is_empty() || stored.count != self.points || source.read(stored, &mut places).is_err() {
            return;
        }
        // Faces are turned around already.
        if mirrored {
            normals.iter_mut().for_each(|normal| normal[0] = -normal[0]);
            places.iter_mut().step_by(3).for_each(|x| *x = -*x);
        }
        let places = places.as_chunks().0;
        self.tracks.part.take_normals(&self.faces, |point| places[point as usize], &normals);
    }

    pub(super) fn part(&self) -> &Part {
        &self.tracks.part
    }

    pub(super) fn is_shown(&self, time: f64) -> bool {
        self.tracks.shown.at(time)
    }

    /// Where the faces at a time are stored.
    fn places(&self, time: f64) -> [Option<Value>; 2] {
        self.tracks.faces.each_ref().map(|part| part.at(time).map(|(value, ..)| value))
    }

    /// How many corners each face of the file has.
    fn arities(&self, source: &mut dyn Values, places: [Option<Value>; 2]) -> Result<Vec<u32>, Fault> {
        let [Some(counts), Some(_)] = places else { return Ok(Vec::new()) };
        let counts = source.integers(counts, most_corners(self.points))?;
        Ok(counts.into_iter().map(|count| count as u32).collect())
    }

    fn read_faces(&mut self, source: &mut dyn Values, places: [Option<Value>; 2]) -> Result<(Polygons, usize), Fault> {
        let [Some(_), Some(corners)] = places else { return Ok(Default::default()) };
        let counts = self.arities(source, places)?;
        let corners = source.integers(corners, most_corners(self.points))?;
        let corners = corners.into_iter().map(|number| number as u32);
        faces(counts.into_iter(), corners, self.points, self.turned)
    }

    /// Refuses faces that are others than those of the first frame.
    fn check_faces(&mut self, source: &mut dyn Values, time: f64) -> Result<(), Fault> {
        let places = self.places(time);
        if self.equal.contains(&places) {
            return Ok(());
        }
        if self.read_faces(source, places)?.0 != self.faces {
            return Err(topology_changes("its faces are not those of frame 0"));
        }
        self.equal = [places, self.equal[0]];
        Ok(())
    }

    /// Reads the points at a time, all of which are overwritten; gives whether all are finite.
    pub(super) fn read(&mut self, source: &mut dyn Values, time: f64, out: &mut [f64]) -> Result<bool, Fault> {
        let Some((value, next, share)) = self.tracks.positions.at(time) else { return Ok(false) };
        let points = source.points(value)?;
        if points.count != self.points {
            let what = format!("it has {} points, and {} in frame 0", points.count, self.points);
            return Err(topology_changes(&what));
        }
        self.check_faces(source, time)?;
        let matrix = self.tracks.chain.matrix(source, time)?;
        let mut finite = source.read(points, out)?;
        let following = if share > 0.0 { Some(source.points(next)?) } else { None };
        // Where the number of points changes, those before hold.
        if let Some(following) = following.filter(|following| following.count == self.points) {
            self.next.resize(out.len(), 0.0);
            finite &= source.read(following, &mut self.next)?;
            out.iter_mut().zip(&self.next).for_each(|(value, next)| *value += share * (next - *value));
            finite &= out.iter().all(|x| x.is_finite());
        }
        if let Some(deformer) = &mut self.tracks.deformer {
            deformer.deform(time, out)?;
            finite &= out.iter().all(|x| x.is_finite());
        }
        Ok(place(matrix, out, finite))
    }
}
