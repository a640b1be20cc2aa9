//! The frames of one mesh of a layer.

use cager_geometry::mesh::Polygons;
use cager_geometry::units::{Units, Up};

use super::choice::choose;
use super::layer::{Attribute, Layer, Value};
use super::timing::Grid;
use super::transform::Chain;
use super::unread;
use crate::dropped::Dropped;
use crate::error::Fault;
use crate::frames::Times;
use crate::scene::{Animation, Faces, Failure, MOST_REPEATED, determinant, most_corners, placed, topology_changes};

/// The unit of layers that do not say theirs: a centimetre.
const USUAL_UNIT: f64 = 0.01;

pub(super) struct MeshFrames<'a> {
    layer: Box<dyn Layer + 'a>,
    /// Index of the prim.
    mesh: u32,
    positions: Attribute,
    /// How many corners faces have, and which.
    parts: [Attribute; 2],
    chain: Chain,
    grid: Grid,
    /// Whether what is wanted is the first frame alone, whatever moves the mesh.
    is_still: bool,
    /// Whether faces are wound clockwise, or turned so by a transform.
    turned: bool,
    faces: Faces,
    /// Where faces are stored that are equal to these, the last ones first.
    equal: [[Option<Value>; 2]; 2],
    points: usize,
    /// The points of the next sample, where a frame lies between two.
    next: Vec<f64>,
    notes: Vec<String>,
}

impl<'a> MeshFrames<'a> {
    pub(super) fn open(mut layer: Box<dyn Layer + 'a>, prim: Option<&str>, is_still: bool) -> Result<Self, Failure> {
        let (mesh, note) = choose(&mut layer, prim)?;
        let notes = note.into_iter().chain(unread::visibility(&mut layer, mesh).unwrap_or_default()).collect();
        let mut attribute = |name| layer.attribute(mesh, name);
        let positions = attribute("points")?;
        let parts = [attribute("faceVertexCounts")?, attribute("faceVertexIndices")?];
        let orientation = attribute("orientation")?;
        let mover = [("primvars:skel:jointIndices", "a skeleton moves"), ("skel:blendShapes", "blend shapes move")];
        for (name, mover) in mover {
            if !is_still && positions.times.is_empty() && !attribute(name)?.is_empty() {
                let what = format!(
                    "has a mesh that {mover}, which is not read; export it with its points baked, or as Alembic"
                );
                return Err(Fault::unsupported(what).into());
            }
        }
        let chain = Chain::of(&mut layer, mesh)?;
        let samples = positions.times.iter().copied().chain(chain.times()).collect();
        let grid = Grid::of(layer.stage(), samples)?;
        let is_left = match orientation.still() {
            Some(told) => layer.tokens(told, 1)? == ["leftHanded"],
            None => false,
        };
        let (faces, equal, next) = (Faces::default(), Default::default(), Vec::new());
        let mut opened = Self {
            layer,
            mesh,
            positions,
            parts,
            chain,
            grid,
            is_still,
            turned: is_left,
            faces,
            equal,
            points: 0,
            next,
            notes,
        };
        opened.points = match opened.positions.at(opened.grid.code(0)) {
            Some((first, ..)) => opened.layer.points(first)?.count,
            None => 0,
        };
        if opened.points == 0 {
            let what = "has a mesh without points in its first frame; export it with its points";
            return Err(Fault::invalid(what).into());
        }
        opened.turned ^= opened.is_mirrored()?;
        let places = opened.places(0);
        opened.faces = opened.read_faces(places)?;
        opened.equal = [places; 2];
        Ok(opened)
    }

    /// Faces of fewer than three corners.
    pub(super) fn left_out(&self) -> usize {
        self.faces.left_out
    }

    /// What is not read of the mesh.
    pub(super) fn add_unread(&mut self, dropped: &mut Dropped) -> Result<(), Failure> {
        unread::add(&mut self.layer, self.mesh, dropped)
    }

    /// Whether the transforms turn the inside out.
    fn is_mirrored(&mut self) -> Result<bool, Failure> {
        // What is not there yet is often scaled to nothing.
        for frame in 0..self.frames().min(MOST_REPEATED) {
            let time = self.grid.code(frame);
            let scale = self.chain.matrix(self.layer.as_mut(), time)?.as_ref().map_or(1.0, determinant);
            if scale != 0.0 {
                return Ok(scale < 0.0);
            }
        }
        Ok(false)
    }

    /// Where the faces of a frame are stored.
    fn places(&self, frame: usize) -> [Option<Value>; 2] {
        self.parts.each_ref().map(|part| part.at(self.grid.code(frame)).map(|(value, ..)| value))
    }

    fn read_faces(&mut self, places: [Option<Value>; 2]) -> Result<Faces, Failure> {
        let [Some(counts), Some(corners)] = places else { return Ok(Faces::default()) };
        let most = most_corners(self.points);
        let [counts, corners] = [self.layer.integers(counts, most)?, self.layer.integers(corners, most)?];
        let [counts, corners] = [counts, corners].map(|numbers| numbers.into_iter().map(|number| number as u32));
        Ok(Faces::of(counts, corners, self.points, self.turned)?)
    }

    /// Refuses a frame whose faces are others than those of the first.
    fn check_faces(&mut self, frame: usize) -> Result<(), Failure> {
        let places = self.places(frame);
        if self.equal.contains(&places) {
            return Ok(());
        }
        if self.read_faces(places)?.polygons != self.faces.polygons {
            return Err(topology_changes("its faces are not those of frame 0").into());
        }
        self.equal = [places, self.equal[0]];
        Ok(())
    }
}

impl Animation for MeshFrames<'_> {
    fn points(&self) -> usize {
        self.points
    }

    fn frames(&self) -> usize {
        if self.is_still { 1 } else { self.grid.frames }
    }

    fn times(&self) -> &Times {
        &self.grid.times
    }

    fn faces(&self) -> &Polygons {
        &self.faces.polygons
    }

    fn notes(&self) -> &[String] {
        &self.notes
    }

    fn units(&self) -> Units {
        let stage = self.layer.stage();
        let unit = stage.metres_per_unit.filter(|&unit| Units::is_length(unit));
        if unit.is_none() && stage.up_is_z.is_none() {
            return Units::UNKNOWN;
        }
        Units::new(if stage.up_is_z == Some(true) { Up::Z } else { Up::Y }, unit.unwrap_or(USUAL_UNIT))
    }

    fn read(&mut self, frame: usize, out: &mut Vec<f64>) -> Result<bool, Failure> {
        let time = self.grid.code(frame);
        let Some((value, next, share)) = self.positions.at(time) else { return Ok(false) };
        let points = self.layer.points(value)?;
        if points.count != self.points {
            let what = format!("it has {} points, and {} in frame 0", points.count, self.points);
            return Err(topology_changes(&what).into());
        }
        self.check_faces(frame)?;
        let matrix = self.chain.matrix(self.layer.as_mut(), time)?;
        // Every value is overwritten below.
        out.resize(3 * self.points, 0.0);
        let mut finite = self.layer.read(points, out)?;
        let following = if share > 0.0 { Some(self.layer.points(next)?) } else { None };
        // Where the number of points changes, those before hold.
        if let Some(following) = following.filter(|following| following.count == self.points) {
            self.next.resize(out.len(), 0.0);
            finite &= self.layer.read(following, &mut self.next)?;
            out.iter_mut().zip(&self.next).for_each(|(value, next)| *value += share * (next - *value));
            finite &= out.iter().all(|x| x.is_finite());
        }
        Ok(placed(matrix.as_ref(), out, finite))
    }
}
