//! The points and faces of placed meshes.

use std::collections::HashMap;

use cager_geometry::mesh::{Model, Point};
use cager_geometry::vector::along;
use gltf::json::mesh::{Mode, Primitive, Semantic};
use gltf::json::validation::Checked;

use super::accessor::{COLORS, POSITIONS, attribute};
use super::alike::Block;
use super::buffers::Buffers;
use super::faults::{damaged, too_large};
use super::scene::{Placement, Scene};
use super::skin::Joints;
use crate::colors::{Colors, Scale, srgb};
use crate::error::Fault;
use crate::faces::{Contents, check_face};

/// Bytes of a point with its colour, and of a corner with its share of a face.
pub(super) const POINT_BYTES: usize = 36;
const CORNER_BYTES: usize = 8;
/// What counts for a primitive, a joint and a point that a target moves: time more than memory.
const PRIMITIVE_BYTES: usize = 256;
const JOINT_BYTES: usize = 256;
const MOVED_BYTES: usize = 4;

/// Puts meshes together, one placement after another.
pub(super) struct Builder<'a, 'b> {
    pub(super) buffers: &'a Buffers<'b>,
    pub(super) scene: &'a Scene,
    contents: Contents,
    pub(super) is_split: bool,
    pub(super) model: Model,
    /// By point as it is stored, as the numbers of those that are kept are.
    colors: Colors,
    pub(super) kept: Vec<u32>,
    /// How many points were stored.
    pub(super) stored: usize,
    /// The node of each part.
    pub(super) nodes: Vec<Option<usize>>,
    /// The numbers of materials among those that are used.
    pub(super) materials: HashMap<usize, u32>,
    /// Bytes that may still be taken, beside those of points and corners.
    most: usize,
}

/// What placements gave.
pub(super) struct Built {
    pub(super) model: Model,
    /// The points that are kept of those that are stored, where these are more; the others are one
    /// with them.
    pub(super) kept: Option<Vec<u32>>,
    /// How many are stored.
    pub(super) stored: usize,
    /// The node of each part, where it has one.
    pub(super) nodes: Vec<Option<usize>>,
}

/// A mesh that is being placed.
pub(super) struct Placed<'a> {
    pub(super) placement: &'a Placement,
    pub(super) joints: Option<Joints>,
    /// By accessor which of the blocks they are, as primitives that differ by their material alone
    /// often share their points.
    points: HashMap<usize, usize>,
    pub(super) blocks: Vec<Block<'a>>,
    /// Primitives with faces: the number of their block, and how many corners they have.
    pub(super) drawn: Vec<(&'a Primitive, usize, usize)>,
    /// Those of all, three of each face.
    pub(super) corners: Vec<u32>,
}

impl Placed<'_> {
    pub(super) fn is_mirrored(&self) -> bool {
        self.joints.as_ref().map_or_else(|| self.placement.mirrored(), Joints::mirror)
    }
}

impl<'a, 'b> Builder<'a, 'b> {
    /// Where `is_split`, points along seams are as many as are stored; without faces they always
    /// are.
    pub(super) fn new(buffers: &'a Buffers<'b>, scene: &'a Scene, contents: Contents, is_split: bool) -> Self {
        let (model, colors, materials) = (Model::default(), Colors::default(), HashMap::new());
        let (kept, stored, nodes, most) = (Vec::new(), 0, Vec::new(), buffers.most_bytes());
        Self { buffers, scene, contents, is_split, model, colors, kept, stored, nodes, materials, most }
    }

    /// The meshes of placements in their order, as one.
    pub(super) fn build(mut self, placements: &[Placement]) -> Result<Built, Fault> {
        placements.iter().try_for_each(|placement| self.place(placement))?;
        self.finish_surface();
        let Self { mut model, colors, kept, stored, nodes, .. } = self;
        let colors = colors.finish(stored, Scale::Fractions);
        let is_merged = kept.len() < stored && self.contents == Contents::PointsAndFaces;
        let kept = is_merged.then_some(kept);
        model.colors = match &kept {
            Some(kept) if !colors.is_empty() => kept.iter().map(|&k| colors[k as usize]).collect(),
            _ => colors,
        };
        Ok(Built { model, kept, stored, nodes })
    }

    fn place(&mut self, placement: &Placement) -> Result<(), Fault> {
        let buffers = self.buffers;
        let mesh = placement.mesh_in(&buffers.root)?;
        let (points, blocks, drawn, corners) = (HashMap::new(), Vec::new(), Vec::new(), Vec::new());
        let mut placed = Placed { placement, joints: None, points, blocks, drawn, corners };
        let first = self.model.points.len();
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
        if self.contents == Contents::PointsAndFaces { self.finish_part(&placed, first) } else { Ok(()) }
    }

    fn primitive<'p>(&mut self, primitive: &'p Primitive, placed: &mut Placed<'p>, place: &str) -> Result<(), Fault> {
        let Checked::Valid(mode) = primitive.mode else {
            return Err(damaged(place, "the mode is unknown"));
        };
        if matches!(mode, Mode::Lines | Mode::LineLoop | Mode::LineStrip) {
            return Ok(());
        }
        let positions = primitive.attributes.get(&Checked::Valid(Semantic::Positions)).ok_or_else(|| {
            Fault::unsupported(format!("{place} has no POSITION; export the mesh without compression"))
        })?;
        let block = match placed.points.get(&positions.value()) {
            Some(&known) => known,
            None => {
                let (first, count) = self.add_points(positions.value(), primitive, placed, place)?;
                // Of primitives that share their points, the first one's.
                let colors = attribute(primitive, Semantic::Colors(0));
                if let Some(colors) = colors.filter(|_| self.contents == Contents::PointsAndFaces) {
                    self.add_colors(colors, count, place);
                }
                placed.points.insert(positions.value(), placed.blocks.len());
                placed.blocks.push(Block { primitive, first, count, is_cloud: true });
                placed.blocks.len() - 1
            }
        };
        if mode == Mode::Points || self.contents == Contents::Points {
            return Ok(());
        }
        placed.blocks[block].is_cloud = false;
        let (base, count) = (placed.blocks[block].first, placed.blocks[block].count);
        let corners = match primitive.indices {
            Some(index) => self.buffers.indices(index.value(), self.room() / CORNER_BYTES, place)?,
            None => {
                self.check_room(CORNER_BYTES * count)?;
                (0..count as u32).collect()
            }
        };
        let (before, mirrored) = (placed.corners.len(), placed.is_mirrored());
        self.add_triangles(&corners, mode, (base, count), mirrored, (&mut placed.corners, place))?;
        placed.drawn.push((primitive, block, placed.corners.len() - before));
        Ok(())
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
        self.stored += points.len();
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
        &self,
        corners: &[u32],
        mode: Mode,
        (base, count): (usize, usize),
        mirrored: bool,
        (added, place): (&mut Vec<u32>, &str),
    ) -> Result<(), Fault> {
        let triangles = match mode {
            Mode::Triangles => corners.len() / 3,
            _ => corners.len().saturating_sub(2),
        };
        if mode == Mode::Triangles && !corners.len().is_multiple_of(3) {
            return Err(damaged(place, format!("{} corners do not make whole triangles", corners.len())));
        }
        self.check_room(CORNER_BYTES * added.len() + triangles.saturating_mul(3 * CORNER_BYTES))?;
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
            added.extend(face.map(|index| index + base as u32));
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
    pub(super) fn take(&mut self, bytes: usize) -> Result<(), Fault> {
        self.most = self.most.checked_sub(bytes).ok_or_else(too_large)?;
        Ok(())
    }

    fn check_room(&self, wanted: usize) -> Result<(), Fault> {
        if wanted <= self.room() { Ok(()) } else { Err(too_large()) }
    }
}
