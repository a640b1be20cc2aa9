//! What a placed mesh is among others: a part, its points merged along seams, with what lies on its
//! faces.

use std::collections::HashMap;
use std::collections::hash_map::Entry;
use std::iter::repeat_n;

use cager_geometry::mesh::{Point, Polygons};
use cager_geometry::surface::{CornerSet, NO_MATERIAL, Part};
use gltf::json::accessor::Type;
use gltf::json::mesh::{Primitive, Semantic};
use gltf::json::validation::Checked;

use super::accessor::{COLORS, NORMALS, POSITIONS, UVS, attribute};
use super::alike::Alike;
use super::builder::{Builder, POINT_BYTES, Placed};
use super::choice::called;
use super::scene::Placement;
use crate::error::Fault;

/// Sets of texture coordinates, and of colours, that are read.
const MOST_SETS: u32 = 8;
/// Bytes of a number of a set.
const SET_BYTES: usize = 4;
/// What cannot be read is left out, so that this is never shown.
const PLACE: &str = "what lies on faces";

impl Builder<'_, '_> {
    /// Ends a mesh, whose points are those from `first` on.
    pub(super) fn finish_part(&mut self, placed: &Placed<'_>, first: usize) -> Result<(), Fault> {
        let count = self.model.points.len() - first;
        if count == 0 {
            return Ok(());
        }
        let all = || ((0..count as u32).collect(), (0..count as u32).collect());
        let (names, kept): (Vec<u32>, Vec<u32>) = self.merged(placed, first).unwrap_or_else(all);
        let corners: Vec<u32> = placed.corners.iter().map(|&corner| names[corner as usize - first]).collect();
        let path = self.path(placed.placement)?;
        let mut part = Part { path, points: kept.len(), faces: corners.len() / 3, ..Part::default() };
        if !corners.is_empty() {
            self.add_sets(&mut part, placed, &corners);
        }
        self.model.surface.parts.push(part);
        self.nodes.push(placed.placement.node);
        for face in corners.as_chunks::<3>().0 {
            self.model.faces.push(&face.map(|point| point + first as u32));
        }
        for (to, &from) in (first..).zip(&kept) {
            self.model.points[to] = self.model.points[first + from as usize];
        }
        self.model.points.truncate(first + kept.len());
        let stored = (self.stored - count) as u32;
        self.kept.extend(kept.iter().map(|&k| k + stored));
        // Those that are merged were work too.
        self.take(POINT_BYTES * (count - kept.len()))
    }

    /// Leaves the surface out where it says nothing.
    pub(super) fn finish_surface(&mut self) {
        let surface = &self.model.surface;
        let is_bare = |part: &Part| part.uv_sets.is_empty() && part.color_sets.is_empty() && part.materials.is_empty();
        let says_nothing = surface.parts.len() < 2
            && surface
                .parts
                .iter()
                .all(|part| is_bare(part) && !part.has_normals_of_its_own(self.model.faces.indices()));
        if says_nothing {
            self.model.surface = Default::default();
        }
    }

    /// The new numbers of points, and those that are kept, where a mesh has what splits points.
    fn merged(&mut self, placed: &Placed<'_>, first: usize) -> Option<(Vec<u32>, Vec<u32>)> {
        let splits = |semantic: &Checked<Semantic>| match semantic {
            Checked::Valid(Semantic::Positions | Semantic::Joints(_) | Semantic::Weights(_)) | Checked::Invalid => {
                false
            }
            Checked::Valid(_) => true,
        };
        let has_seams = placed.drawn.iter().any(|(primitive, ..)| primitive.attributes.keys().any(splits))
            || placed.drawn.windows(2).any(|pair| pair[0].0.material != pair[1].0.material);
        if self.is_split || !has_seams {
            return None;
        }
        let buffers = self.buffers;
        // What cannot be read moves no point, or is told where it does.
        let alike = Alike::of(&placed.blocks, first, placed.joints.is_some(), buffers, |bytes| self.take(bytes));
        Some(alike.ok()?.merged())
    }

    /// Names of nodes from the root, or that of a mesh without one.
    fn path(&mut self, placement: &Placement) -> Result<String, Fault> {
        let root = &self.buffers.root;
        let Some(node) = placement.node else {
            let name = root.meshes.get(placement.mesh).and_then(|mesh| mesh.name.as_ref());
            return Ok(format!("/{}", called(name, "mesh", placement.mesh).replace('/', "_")));
        };
        let (mut names, mut next) = (Vec::new(), Some(node));
        while let Some(node) = next {
            let name = called(root.nodes[node].name.as_ref(), "node", node);
            // Many meshes below long names would take any memory.
            self.take(name.len() + 1)?;
            names.push(name.replace('/', "_"));
            next = self.scene.places.get(node).and_then(Option::as_ref).and_then(|place| place.parent);
        }
        Ok(names.iter().rev().flat_map(|name| ["/", name]).collect())
    }

    /// Texture coordinates, colours, hard edges and materials.
    fn add_sets(&mut self, part: &mut Part, placed: &Placed<'_>, points: &[u32]) {
        let buffers = self.buffers;
        for set in 0..MOST_SETS {
            let name = Semantic::TexCoords(set);
            let read = |primitive: &Primitive, index, most| {
                let uvs = buffers.values(index, &UVS, most, PLACE).ok()?;
                let look = primitive.material.and_then(|material| buffers.materials.get(material.value()));
                let moved = look.and_then(|look| look.moved.as_ref()).filter(|(_, sets)| sets.contains(&set.into()));
                let placed = |uv| moved.map_or(uv, |(transform, _)| transform.apply(uv));
                // It points downwards in the file.
                let turned = |[u, v]: [f64; 2]| [u, 1.0 - v];
                Some(uvs.into_iter().map(|uv| turned(placed(uv)).map(|x| x as f32)).collect())
            };
            if let Some(values) = self.by_corner(placed, &name, [0.0; 2], read) {
                part.uv_sets.push(shared(&name, points, &values));
            }
            let name = Semantic::Colors(set);
            let read = |_: &Primitive, index: usize, most| {
                let is_opaque = buffers.root.accessors.get(index)?.type_ == Checked::Valid(Type::Vec3);
                let colors = buffers.values(index, &COLORS, most, PLACE).ok()?;
                let color =
                    |[red, green, blue, alpha]: [f64; 4]| [red, green, blue, if is_opaque { 1.0 } else { alpha }];
                Some(colors.into_iter().map(|found| color(found).map(|x| x as f32)).collect())
            };
            if let Some(values) = self.by_corner(placed, &name, [1.0; 4], read) {
                part.color_sets.push(shared(&name, points, &values));
            }
        }
        let read = |_: &Primitive, index, most| {
            let normals = buffers.values::<3>(index, &NORMALS, most, PLACE).ok()?;
            Some(normals.into_iter().map(|normal| normal.map(|x| x as f32)).collect())
        };
        if placed.drawn.iter().all(|(primitive, ..)| attribute(primitive, Semantic::Normals).is_some())
            && let Some(normals) = self.by_corner(placed, &Semantic::Normals, [0.0; 3], read)
        {
            let mut numbers = HashMap::new();
            let number = |normal: &[f32; 3]| {
                let next = numbers.len() as u32;
                *numbers.entry(bits(normal)).or_insert(next)
            };
            part.normals = normals.iter().map(number).collect();
            self.add_tilts(part, placed, points, normals);
        }
        if placed.drawn.iter().any(|(primitive, ..)| primitive.material.is_some()) {
            for &(primitive, _, corners) in &placed.drawn {
                let material = primitive.material.map_or(NO_MATERIAL, |material| self.material(material.value()));
                part.materials.extend(repeat_n(material, corners / 3));
            }
        }
    }

    /// How normals are tilted, from the points that no joint and no target moves, as these are their normals.
    fn add_tilts(&mut self, part: &mut Part, placed: &Placed<'_>, points: &[u32], mut normals: Vec<[f32; 3]>) {
        let buffers = self.buffers;
        let read = |_: &Primitive, index, most| {
            let places: Vec<Point> = buffers.values(index, &POSITIONS, most, PLACE).ok()?;
            Some(places.into_iter().map(|place| place.map(|x| x as f32)).collect())
        };
        let Some(places) = self.by_corner(placed, &Semantic::Positions, [0.0; 3], read) else { return };
        let mut still = vec![[0.0; 3]; part.points];
        points.iter().zip(&places).for_each(|(&point, place)| still[point as usize] = place.map(f64::from));
        // Faces are turned around already.
        if placed.is_mirrored() {
            normals.iter_mut().for_each(|normal| normal[0] = -normal[0]);
            still.iter_mut().for_each(|place| place[0] = -place[0]);
        }
        let faces = Polygons::of_triangles(points.as_chunks().0);
        part.take_tilts(&faces, |point| still[point as usize], &normals);
    }

    /// An attribute of each corner; none where no primitive has it, or one's cannot be read.
    fn by_corner<const N: usize>(
        &mut self,
        placed: &Placed<'_>,
        semantic: &Semantic,
        missing: [f32; N],
        read: impl Fn(&Primitive, usize, usize) -> Option<Vec<[f32; N]>>,
    ) -> Option<Vec<[f32; N]>> {
        let index = |primitive| attribute(primitive, semantic.clone());
        if placed.drawn.iter().all(|&(primitive, ..)| index(primitive).is_none()) {
            return None;
        }
        self.take(SET_BYTES * (N + 1) * placed.corners.len()).ok()?;
        let (mut values, mut known) = (Vec::with_capacity(placed.corners.len()), HashMap::new());
        let mut corners = placed.corners.as_slice();
        for &(primitive, block, count) in &placed.drawn {
            let block = &placed.blocks[block];
            let own = corners.split_off(..count)?;
            let Some(index) = index(primitive) else {
                values.extend(repeat_n(missing, count));
                continue;
            };
            let stored = match known.entry((index, primitive.material.map(|material| material.value()))) {
                Entry::Occupied(stored) => stored.into_mut(),
                Entry::Vacant(place) => {
                    self.take(SET_BYTES * N * block.count).ok()?;
                    place.insert(read(primitive, index, block.count)?)
                }
            };
            for &corner in own {
                values.push(*stored.get(corner as usize - block.first)?);
            }
        }
        values.iter().flatten().all(|x| x.is_finite()).then_some(values)
    }

    /// The number of a material among those that are used.
    fn material(&mut self, index: usize) -> u32 {
        let Some(look) = self.buffers.materials.get(index) else { return NO_MATERIAL };
        let used = &mut self.model.surface.materials;
        *self.materials.entry(index).or_insert_with(|| {
            used.push(look.material.clone());
            used.len() as u32 - 1
        })
    }
}

/// Values of corners, one for those of a point that have the same.
fn shared<const N: usize>(name: &Semantic, points: &[u32], by_corner: &[[f32; N]]) -> CornerSet<N> {
    let mut set = CornerSet { name: name.to_string(), ..CornerSet::default() };
    let mut known = HashMap::new();
    for (point, value) in points.iter().zip(by_corner) {
        let number = *known.entry((point, bits(value))).or_insert_with(|| {
            set.values.push(*value);
            set.values.len() as u32 - 1
        });
        set.corners.push(number);
    }
    set
}

/// 0 and −0 are one.
fn bits<const N: usize>(value: &[f32; N]) -> [u32; N] {
    value.map(|x| (x + 0.0).to_bits())
}
