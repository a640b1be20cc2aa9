//! What lies on the faces of a mesh.

use cager_geometry::mesh::Polygons;
use cager_geometry::surface::{CornerSet, Crease, FaceGroup, Part, Subdivision};
use ufbx::{Mesh, SubdivisionDisplayMode, VertexVec2, VertexVec4};

use crate::colors::linear;
use crate::error::Fault;
use crate::faces::check_face;

/// The sharpness of an edge whose crease is 1.
const SHARPEST: f64 = 10.0;

/// Faces of three corners and more.
#[derive(Default)]
pub(super) struct Kept {
    /// Their numbers in the file, and how many corners each has.
    pub(super) faces: Vec<u32>,
    arities: Vec<u32>,
    /// The numbers of their corners in the file, and the point of each.
    corners: Vec<usize>,
    points: Vec<u32>,
    turned: bool,
}

impl Kept {
    /// Those of a mesh, in the opposite order of corners where `turned`.
    pub(super) fn of(mesh: &Mesh, turned: bool) -> Result<Self, Fault> {
        let mut kept = Self { turned, ..Self::default() };
        for (number, face) in (0..).zip(&mesh.faces).filter(|(_, face)| face.num_indices >= 3) {
            let (begin, first) = (face.index_begin as usize, kept.corners.len());
            kept.corners.extend(begin..begin + face.num_indices as usize);
            if turned {
                kept.corners[first..].reverse();
            }
            let point = |&corner: &usize| mesh.vertex_indices.as_ref().get(corner).copied().unwrap_or(u32::MAX);
            kept.points.extend(kept.corners[first..].iter().map(point));
            check_face(&kept.points[first..], mesh.num_vertices, || format!("face {number}"))?;
            kept.faces.push(number);
            kept.arities.push(face.num_indices);
        }
        Ok(kept)
    }

    /// Adds the faces to those of other meshes, `before` which have so many points.
    pub(super) fn add_to(&self, all: &mut Polygons, before: u32) {
        let mut rest = self.points.as_slice();
        for &arity in &self.arities {
            let (face, others) = rest.split_at(arity as usize);
            rest = others;
            all.push(&face.iter().map(|&point| point + before).collect::<Vec<_>>());
        }
    }

    /// All but its path and its materials.
    pub(super) fn part(&self, mesh: &Mesh) -> Part {
        let sets = mesh.uv_sets.iter().map(|set| self.uv_set(&set.name, &set.vertex_uv));
        let color_sets = mesh.color_sets.iter().map(|set| self.color_set(&set.name, &set.vertex_color));
        let is_smooth = matches!(
            mesh.subdivision_display_mode,
            SubdivisionDisplayMode::Smooth | SubdivisionDisplayMode::HullAndSmooth
        );
        let mut part = Part {
            points: mesh.num_vertices,
            faces: self.faces.len(),
            uv_sets: sets.flatten().collect(),
            color_sets: color_sets.flatten().collect(),
            subdivision: if is_smooth { Subdivision::CatmullClark } else { Subdivision::None },
            creases: creases(mesh),
            groups: self.groups(mesh),
            ..Part::default()
        };
        self.take_normals(mesh, &mut part);
        part
    }

    fn uv_set(&self, name: &str, stored: &VertexVec2) -> Option<CornerSet<2>> {
        let values = stored.values.iter().map(|value| [value.x as f32, value.y as f32]).collect();
        self.set(name, values, &stored.indices)
    }

    /// Programs write colours in sRGB, as Blender does.
    fn color_set(&self, name: &str, stored: &VertexVec4) -> Option<CornerSet<4>> {
        let value = |value: &ufbx::Vec4| {
            let [red, green, blue] = [value.x, value.y, value.z].map(|x| linear(x as f32));
            [red, green, blue, value.w as f32]
        };
        self.set(name, stored.values.iter().map(value).collect(), &stored.indices)
    }

    /// Corners without a value have one of zeros; none where a value is not finite.
    fn set<const N: usize>(&self, name: &str, mut values: Vec<[f32; N]>, indices: &[u32]) -> Option<CornerSet<N>> {
        let known = values.len();
        let number = |&corner: &usize| match indices.get(corner) {
            Some(&index) if (index as usize) < known => index,
            _ => known as u32,
        };
        let corners: Vec<u32> = self.corners.iter().map(number).collect();
        if corners.contains(&(known as u32)) {
            values.push([0.0; N]);
        }
        let is_finite = values.as_flattened().iter().all(|x| x.is_finite());
        (known > 0 && is_finite).then(|| CornerSet { name: name.to_owned(), values, corners })
    }

    /// Those of the points that no joint and no target moves.
    fn take_normals(&self, mesh: &Mesh, part: &mut Part) {
        let stored = &mesh.vertex_normal;
        // Of what a transform mirrors, faces are turned around already.
        let side = if self.turned { -1.0 } else { 1.0 };
        let normal = |&corner: &usize| {
            let value = stored.values.as_ref().get(*stored.indices.as_ref().get(corner)? as usize)?;
            Some([side * value.x, value.y, value.z].map(|x| x as f32))
        };
        let all: Option<Vec<_>> = self.corners.iter().map(normal).collect();
        let Some(normals) = all.filter(|_| stored.exists) else { return };
        let mut faces = Polygons::new();
        self.add_to(&mut faces, 0);
        let place = |point: &ufbx::Vec3| [side * point.x, point.y, point.z];
        let point = |point: u32| mesh.vertices.as_ref().get(point as usize).map_or([0.0; 3], place);
        part.take_normals(&faces, point, &normals);
    }

    /// Where faces are in more than one.
    fn groups(&self, mesh: &Mesh) -> Vec<FaceGroup> {
        let named = |group: &ufbx::FaceGroup| match &*group.name {
            "" => group.id.to_string(),
            name => name.to_owned(),
        };
        let mut groups: Vec<FaceGroup> =
            mesh.face_groups.iter().map(|group| FaceGroup { name: named(group), faces: Vec::new() }).collect();
        for (face, &stored) in (0..).zip(&self.faces) {
            let group = mesh.face_group.as_ref().get(stored as usize).and_then(|&group| groups.get_mut(group as usize));
            group.into_iter().for_each(|group| group.faces.push(face));
        }
        groups.retain(|group| !group.faces.is_empty());
        if groups.len() > 1 { groups } else { Vec::new() }
    }
}

/// Edges are stored as two corners.
fn creases(mesh: &Mesh) -> Vec<Crease> {
    let point = |corner: u32| mesh.vertex_indices.as_ref().get(corner as usize).copied();
    let crease = |(edge, &crease): (&ufbx::Edge, &f64)| {
        let ends = [point(edge.a)?, point(edge.b)?];
        let is_one = crease > 0.0 && crease.is_finite() && ends.iter().all(|&end| (end as usize) < mesh.num_vertices);
        let edge = [ends[0].min(ends[1]), ends[0].max(ends[1])];
        is_one.then_some(Crease { edge, sharpness: (SHARPEST * crease) as f32 })
    };
    mesh.edges.iter().zip(&mesh.edge_crease).filter_map(crease).collect()
}
