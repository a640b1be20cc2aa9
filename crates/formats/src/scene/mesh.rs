//! The frames of one mesh of a scene, whatever file it is in.

use std::path::Path;

use cager_geometry::mesh::{Model, Polygons};
use cager_geometry::units::Units;

use super::faces::{faces, most_corners, topology_changes};
use super::reader::{Animation, MeshInfo, open};
use super::track::{MOST_REPEATED, Timeline, Track, Value, Values};
use super::transform::{Chain, place};
use crate::error::{Error, Fault};

/// What a parser finds of a mesh.
#[derive(Default)]
pub(crate) struct MeshTracks {
    pub(crate) positions: Track,
    /// How many corners faces have, and which.
    pub(crate) faces: [Track; 2],
    pub(crate) is_clockwise: bool,
    pub(crate) chain: Chain,
    pub(crate) timeline: Timeline,
    pub(crate) units: Units,
    /// What the user should know of how it is read.
    pub(crate) notes: Vec<String>,
}

pub(crate) struct MovingMesh<'a> {
    source: Box<dyn Values + 'a>,
    tracks: MeshTracks,
    /// Whether faces are turned around as they are read.
    turned: bool,
    /// Where faces are stored that are equal to these, the last ones first.
    equal: [[Option<Value>; 2]; 2],
    info: MeshInfo,
    /// Faces of fewer than three corners.
    left_out: usize,
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

/// The fault of a mesh that begins with nothing.
pub(crate) fn no_points() -> Fault {
    Fault::invalid("has a mesh without points in its first frame; export it with its points")
}

impl<'a> MovingMesh<'a> {
    pub(crate) fn new(mut source: Box<dyn Values + 'a>, mut tracks: MeshTracks) -> Result<Self, Fault> {
        let points = match tracks.positions.at(tracks.timeline.at[0]) {
            Some((first, ..)) => source.points(first)?.count,
            None => 0,
        };
        if points == 0 {
            return Err(no_points());
        }
        let mut turned = tracks.is_clockwise;
        // What is not there yet is often scaled to nothing.
        for &time in tracks.timeline.at.iter().take(MOST_REPEATED) {
            let matrix = tracks.chain.matrix(source.as_mut(), time)?;
            let scale = matrix.map_or(1.0, |matrix| matrix.matrix3.determinant());
            if scale != 0.0 {
                turned ^= scale < 0.0;
                break;
            }
        }
        let info = MeshInfo {
            points,
            frames: tracks.timeline.at.len(),
            times: std::mem::take(&mut tracks.timeline.times),
            units: tracks.units,
            notes: std::mem::take(&mut tracks.notes),
            faces: Polygons::new(),
        };
        let (equal, next) = ([[None; 2]; 2], Vec::new());
        let mut mesh = Self { source, tracks, turned, equal, info, left_out: 0, next };
        let places = mesh.places(0);
        (mesh.info.faces, mesh.left_out) = mesh.read_faces(places)?;
        mesh.equal = [places; 2];
        Ok(mesh)
    }

    /// The first frame, and how many faces were left out that have fewer than three corners.
    pub(crate) fn into_model(self, path: &Path) -> Result<(Model, usize, Units), Error> {
        let (points, left_out, units, mut values) = (self.info.points, self.left_out, self.info.units, Vec::new());
        let mut reader = open(path, self, points)?;
        reader.read_next(&mut values)?;
        let faces = reader.mesh().map(|(_, faces)| faces.clone()).unwrap_or_default();
        Ok((Model { points: values.as_chunks().0.to_vec(), faces, ..Model::default() }, left_out, units))
    }

    /// Where the faces of a frame are stored.
    fn places(&self, frame: usize) -> [Option<Value>; 2] {
        let time = self.tracks.timeline.at[frame];
        self.tracks.faces.each_ref().map(|part| part.at(time).map(|(value, ..)| value))
    }

    fn read_faces(&mut self, places: [Option<Value>; 2]) -> Result<(Polygons, usize), Fault> {
        let [Some(counts), Some(corners)] = places else { return Ok(Default::default()) };
        let most = most_corners(self.info.points);
        let [counts, corners] = [self.source.integers(counts, most)?, self.source.integers(corners, most)?];
        let [counts, corners] = [counts, corners].map(|numbers| numbers.into_iter().map(|number| number as u32));
        faces(counts, corners, self.info.points, self.turned)
    }

    /// Refuses a frame whose faces are others than those of the first.
    fn check_faces(&mut self, frame: usize) -> Result<(), Fault> {
        let places = self.places(frame);
        if self.equal.contains(&places) {
            return Ok(());
        }
        if self.read_faces(places)?.0 != self.info.faces {
            return Err(topology_changes("its faces are not those of frame 0"));
        }
        self.equal = [places, self.equal[0]];
        Ok(())
    }
}

impl Animation for MovingMesh<'_> {
    fn info(&self) -> &MeshInfo {
        &self.info
    }

    fn read(&mut self, frame: usize, out: &mut Vec<f64>) -> Result<bool, Fault> {
        let time = self.tracks.timeline.at[frame];
        let Some((value, next, share)) = self.tracks.positions.at(time) else { return Ok(false) };
        let points = self.source.points(value)?;
        if points.count != self.info.points {
            let what = format!("it has {} points, and {} in frame 0", points.count, self.info.points);
            return Err(topology_changes(&what));
        }
        self.check_faces(frame)?;
        let matrix = self.tracks.chain.matrix(self.source.as_mut(), time)?;
        // Every value is overwritten below.
        out.resize(3 * self.info.points, 0.0);
        let mut finite = self.source.read(points, out)?;
        let following = if share > 0.0 { Some(self.source.points(next)?) } else { None };
        // Where the number of points changes, those before hold.
        if let Some(following) = following.filter(|following| following.count == self.info.points) {
            self.next.resize(out.len(), 0.0);
            finite &= self.source.read(following, &mut self.next)?;
            out.iter_mut().zip(&self.next).for_each(|(value, next)| *value += share * (next - *value));
            finite &= out.iter().all(|x| x.is_finite());
        }
        Ok(place(matrix, out, finite))
    }
}
