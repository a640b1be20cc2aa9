//! The points and faces of placed meshes.

use std::collections::HashMap;

use cager_geometry::mesh::{Model, Point};
use cager_geometry::vector::along;
use gltf::json::mesh::{Mode, Primitive, Semantic};
use gltf::json::validation::Checked;

use super::accessor::{COLORS, POSITIONS};
use super::buffers::Buffers;
use super::document::{DRACO, draco};
use super::faults::{damaged, too_large};
use super::scene::{Placement, Scene};
use super::skin::Joints;
use crate::colors::{Colors, Scale, srgb};
use crate::error::Fault;
use crate::faces::{Contents, check_face};

/// Bytes of a point with its colour, and of a corner with its share of a face.
const POINT_BYTES: usize = 36;
const CORNER_BYTES: usize = 8;
/// What counts for a primitive, a joint and a point that a target moves: time more than memory.
const PRIMITIVE_BYTES: usize = 256;
const JOINT_BYTES: usize = 256;
const MOVED_BYTES: usize = 4;

/// Puts meshes together, one placement after another.
pub(super) struct Builder<'a, 'b> {
    buffers: &'a Buffers<'b>,
    scene: &'a Scene,
    contents: Contents,
    model: Model,
    colors: Colors,
    /// Bytes that may still be taken, beside those of points and corners.
    most: usize,
}

/// A mesh that is being placed.
struct Placed<'a> {
    placement: &'a Placement,
    joints: Option<Joints>,
    /// The first point and how many there are by accessor, as primitives that differ by their
    /// material alone often share their points.
    points: HashMap<usize, (usize, usize)>,
}

impl Placed<'_> {
    fn is_mirrored(&self) -> bool {
        self.joints.as_ref().map_or_else(|| self.placement.mirrored(), Joints::mirror)
    }
}

impl<'a, 'b> Builder<'a, 'b> {
    pub(super) fn new(buffers: &'a Buffers<'b>, scene: &'a Scene, contents: Contents) -> Self {
        let (model, colors) = (Model::default(), Colors::default());
        Self { buffers, scene, contents, model, colors, most: buffers.most_bytes() }
    }

    /// The meshes of placements in their order, as one.
    pub(super) fn build(mut self, placements: &[Placement]) -> Result<Model, Fault> {
        placements.iter().try_for_each(|placement| self.place(placement))?;
        let Self { mut model, colors, .. } = self;
        model.colors = colors.finish(model.points.len(), Scale::Fractions);
        Ok(model)
    }

    fn place(&mut self, placement: &Placement) -> Result<(), Fault> {
        let mesh = placement.mesh_in(&self.buffers.root)?;
        let mut placed = Placed { placement, joints: None, points: HashMap::new() };
        if let Some(skin) = placement.skin {
            let (joints, read) = Joints::of(skin, self.scene, self.buffers, self.most / JOINT_BYTES)?;
            self.take(JOINT_BYTES * read)?;
            placed.joints = Some(joints);
        }
        for (k, primitive) in mesh.primitives.iter().enumerate() {
            // Counted even if empty: the work, not the memory alone, is bounded.
            self.take(PRIMITIVE_BYTES)?;
            let place = format!("mesh {}, primitive {k}", placement.mesh);
            self.primitive(primitive, &mut placed, &place)?;
        }
        Ok(())
    }

    fn primitive(&mut self, primitive: &Primitive, placed: &mut Placed<'_>, place: &str) -> Result<(), Fault> {
        let Checked::Valid(mode) = primitive.mode else {
            return Err(damaged(place, "the mode is unknown"));
        };
        if matches!(mode, Mode::Lines | Mode::LineLoop | Mode::LineStrip) {
            return Ok(());
        }
        let extensions = primitive.extensions.as_ref().map(|extensions| &extensions.others);
        let is_draco = extensions.is_some_and(|extensions| extensions.contains_key(DRACO));
        let positions = primitive.attributes.get(&Checked::Valid(Semantic::Positions)).ok_or_else(|| {
            Fault::unsupported(format!("{place} has no POSITION; export the mesh without compression"))
        })?;
        // Some files have the plain data as well.
        if is_draco && self.buffers.root.accessors.get(positions.value()).is_some_and(|a| a.buffer_view.is_none()) {
            return Err(draco());
        }
        let (base, count) = match placed.points.get(&positions.value()) {
            Some(&known) => known,
            None => {
                let added = self.add_points(positions.value(), primitive, placed, place)?;
                // Of primitives that share their points, the first one's.
                let colors = primitive.attributes.get(&Checked::Valid(Semantic::Colors(0)));
                if let Some(colors) = colors.filter(|_| self.contents == Contents::PointsAndFaces) {
                    self.add_colors(colors.value(), added.1, place);
                }
                placed.points.insert(positions.value(), added);
                added
            }
        };
        if mode == Mode::Points || self.contents == Contents::Points {
            return Ok(());
        }
        let corners = match primitive.indices {
            Some(index) => self.buffers.indices(index.value(), self.room() / CORNER_BYTES, place)?,
            None => {
                self.check_room(CORNER_BYTES * count)?;
                (0..count as u32).collect()
            }
        };
        self.add_triangles(&corners, mode, (base, count), placed.is_mirrored(), place)
    }

    fn add_points(
        &mut self,
        index: usize,
        primitive: &Primitive,
        placed: &Placed<'_>,
        place: &str,
    ) -> Result<(usize, usize), Fault> {
        let mut points = self.buffers.values(index, &POSITIONS, self.room() / POINT_BYTES, place)?;
        self.morph(&mut points, primitive, placed.placement, place)?;
        if let Some(joints) = &placed.joints {
            joints.pose(&mut points, primitive, self.buffers, place)?;
        }
        let base = self.model.points.len();
        for (k, &point) in points.iter().enumerate() {
            let point: Point = placed.placement.apply(point);
            if !point.iter().all(|x| x.is_finite()) {
                return Err(Fault::invalid(format!(
                    "{place}: vertex {k} has a coordinate that is NaN or infinite; repair or remove it"
                )));
            }
            self.model.points.push(point);
        }
        Ok((base, points.len()))
    }

    /// Adds the differences of morph targets, as far as the node or else the mesh has them at rest.
    fn morph(
        &mut self,
        points: &mut [Point],
        primitive: &Primitive,
        placement: &Placement,
        place: &str,
    ) -> Result<(), Fault> {
        let node = placement.node.and_then(|node| self.buffers.root.nodes[node].weights.as_ref());
        let weights = node.or(self.buffers.root.meshes[placement.mesh].weights.as_ref());
        let targets = primitive.targets.iter().flatten().zip(weights.into_iter().flatten());
        for (target, &weight) in targets.filter(|&(_, &weight)| weight != 0.0) {
            let Some(positions) = &target.positions else { continue };
            let (target, weight) = (positions.value(), f64::from(weight));
            // Of most targets only some points move.
            if let Some(moved) = self.buffers.moved_points(target, points.len(), place)? {
                self.take(MOVED_BYTES * (moved.len() + 1))?;
                for (at, moved) in moved {
                    points[at] = along(points[at], weight, moved);
                }
                continue;
            }
            self.take(MOVED_BYTES * (points.len() + 1))?;
            let moved: Vec<Point> = self.buffers.values(target, &POSITIONS, points.len(), place)?;
            for (point, moved) in points.iter_mut().zip(moved) {
                *point = along(*point, weight, moved);
            }
        }
        Ok(())
    }

    /// Colours that cannot be read leave the model without any.
    fn add_colors(&mut self, index: usize, points: usize, place: &str) {
        let colors: Vec<[f64; 3]> = self.buffers.values(index, &COLORS, points, place).unwrap_or_default();
        if colors.len() == points {
            colors.into_iter().for_each(|color| self.colors.push(color.map(|x| srgb(x.clamp(0.0, 1.0) as f32))));
        }
    }

    fn add_triangles(
        &mut self,
        corners: &[u32],
        mode: Mode,
        (base, count): (usize, usize),
        mirrored: bool,
        place: &str,
    ) -> Result<(), Fault> {
        let triangles = match mode {
            Mode::Triangles => corners.len() / 3,
            _ => corners.len().saturating_sub(2),
        };
        if mode == Mode::Triangles && !corners.len().is_multiple_of(3) {
            return Err(damaged(place, format!("{} corners do not make whole triangles", corners.len())));
        }
        self.check_room(triangles.saturating_mul(3 * CORNER_BYTES))?;
        for k in 0..triangles {
            let mut face = match mode {
                Mode::Triangles => [corners[3 * k], corners[3 * k + 1], corners[3 * k + 2]],
                Mode::TriangleFan => [corners[0], corners[k + 1], corners[k + 2]],
                // Every other triangle of a strip is turned around.
                _ => [corners[k], corners[k + 1 + k % 2], corners[k + 2 - k % 2]],
            };
            check_face(&face, count, || format!("{place}, triangle {k}"))?;
            if mirrored {
                face.swap(1, 2);
            }
            // `room` keeps all points within `u32`.
            self.model.faces.push(&face.map(|index| index + base as u32));
        }
        Ok(())
    }

    /// Bytes that points and corners may still take.
    fn room(&self) -> usize {
        let used = POINT_BYTES * self.model.points.len() + CORNER_BYTES * self.model.faces.indices().len();
        // What counts points and corners has 32 bits.
        self.most.min(CORNER_BYTES * u32::MAX as usize).saturating_sub(used)
    }

    /// Counts work, and memory that is given back.
    fn take(&mut self, bytes: usize) -> Result<(), Fault> {
        self.most = self.most.checked_sub(bytes).ok_or_else(too_large)?;
        Ok(())
    }

    fn check_room(&self, wanted: usize) -> Result<(), Fault> {
        if wanted <= self.room() { Ok(()) } else { Err(too_large()) }
    }
}
