//! The meshes of a file: the parts of a model, their points split where corners have other texture
//! coordinates, colours or normals.

use std::collections::HashMap;
use std::ops::Range;

use cager_geometry::mesh::{Point, Polygons};
use cager_geometry::surface::{CornerSet, NO_MATERIAL, Part, PartRange, SharedNormals, Surface};

use crate::normals::{unit, vertex_normals};

/// Names of a path that become nodes; of longer ones those before the last are left out.
const DEEPEST: usize = 64;

/// A mesh of the file.
pub(crate) struct Piece {
    /// Names of nodes from the root down to its own.
    pub(super) path: Vec<String>,
    /// The point of each vertex.
    pub(super) vertices: Vec<u32>,
    /// The material and the triangles of each primitive; none of a cloud.
    pub(super) primitives: Vec<(u32, Vec<[u32; 3]>)>,
    /// By set and vertex, `v` downwards.
    pub(super) uv_sets: Vec<Vec<[f32; 2]>>,
    pub(super) uv_names: Vec<String>,
    pub(super) color_sets: Vec<Vec<[f32; 4]>>,
    pub(super) normals: Option<Normals>,
    /// Frames in which it is shown, where it is not always.
    pub(super) shown: Option<Vec<Range<u32>>>,
}

/// How the normals of a mesh are computed.
pub(super) struct Normals {
    from: From,
    /// The normal of each vertex.
    pub(super) of_vertices: Vec<u32>,
}

enum From {
    /// Of each point, by the areas of these triangles.
    Triangles(Vec<[u32; 3]>),
    /// Of corners that share them, of the points behind this one.
    Shared(SharedNormals, usize),
}

impl Piece {
    /// Of a model with nothing on its faces: one mesh of this name.
    pub(crate) fn bare(name: &str, points: usize, faces: &Polygons, has_normals: bool) -> Self {
        let triangles = faces.triangulated();
        let vertices: Vec<u32> = (0..points as u32).collect();
        let normals = (has_normals && !triangles.is_empty())
            .then(|| Normals { from: From::Triangles(triangles.clone()), of_vertices: vertices.clone() });
        Self {
            path: vec![name.to_owned()],
            vertices,
            primitives: if triangles.is_empty() { Vec::new() } else { vec![(NO_MATERIAL, triangles)] },
            uv_sets: Vec::new(),
            uv_names: Vec::new(),
            color_sets: Vec::new(),
            normals,
            shown: None,
        }
    }

    /// Of the parts of a model; those without a name have this one. Parts with normals have them
    /// anyway.
    pub(crate) fn of(surface: &Surface, faces: &Polygons, name: &str, has_normals: bool) -> Vec<Self> {
        surface.ranges(faces).map(|(part, range)| Self::of_part(part, &range, faces, (name, has_normals))).collect()
    }

    /// Whether it is hidden in the first frame.
    pub(crate) fn is_hidden(&self) -> bool {
        self.shown.as_ref().is_some_and(|shown| shown.first().is_none_or(|range| range.start > 0))
    }

    fn of_part(part: &Part, range: &PartRange, faces: &Polygons, (name, has_normals): (&str, bool)) -> Self {
        let local = range.local(faces);
        let corners = local.indices();
        let shared = if part.normals.is_empty() {
            // Smooth everywhere.
            has_normals.then(|| SharedNormals::new(local.clone(), &vec![0; corners.len()]))
        } else {
            Some(SharedNormals::of(part, local.clone()))
        };
        let shared = shared.filter(|shared| shared.count > 0);
        let sets = part.uv_sets.iter().map(|set| &set.corners).chain(part.color_sets.iter().map(|set| &set.corners));
        let sets = sets.chain(shared.iter().map(|shared| &shared.corners));
        let Split { vertices, firsts, of_corners } = Split::of(part.points, corners, sets);
        let of_vertices = shared.as_ref().map(|shared| at_vertices(&firsts, |corner| shared.corners[corner]));
        let normals = shared.map(|shared| From::Shared(shared, range.points.start)).zip(of_vertices);
        let mut path: Vec<String> = part.path.split('/').filter(|name| !name.is_empty()).map(str::to_owned).collect();
        if path.len() > DEEPEST {
            path.drain(DEEPEST - 1..path.len() - 1);
        }
        Self {
            path: if path.is_empty() { vec![name.to_owned()] } else { path },
            vertices: vertices.iter().map(|&point| point + range.points.start as u32).collect(),
            primitives: primitives(&local, &part.materials, &of_corners),
            uv_sets: part.uv_sets.iter().map(|set| values(set, &firsts, |[u, v]| [u, 1.0 - v])).collect(),
            uv_names: part.uv_sets.iter().map(|set| set.name.clone()).collect(),
            color_sets: part.color_sets.iter().map(|set| values(set, &firsts, |color| color)).collect(),
            normals: normals.map(|(from, of_vertices)| Normals { from, of_vertices }),
            shown: part.shown.clone(),
        }
    }
}

impl Normals {
    /// How many there are.
    pub(super) fn count(&self, points: usize) -> usize {
        match &self.from {
            From::Triangles(_) => points,
            From::Shared(shared, _) => shared.count,
        }
    }

    /// Those of a frame.
    pub(super) fn at(&self, positions: &[f32]) -> Vec<[f32; 3]> {
        match &self.from {
            From::Triangles(triangles) => {
                let mut normals = Vec::new();
                vertex_normals(positions, triangles, &mut normals);
                normals
            }
            From::Shared(shared, first) => {
                let points = positions.as_chunks::<3>().0;
                let at = |point: u32| -> Point { points[first + point as usize].map(f64::from) };
                shared.at(at).into_iter().map(unit).collect()
            }
        }
    }
}

/// Points split into vertices, in the order of the points.
struct Split {
    /// The point of each vertex.
    vertices: Vec<u32>,
    /// Its first corner; none of a point without a face.
    firsts: Vec<Option<usize>>,
    /// The vertex of each corner.
    of_corners: Vec<u32>,
}

impl Split {
    fn of<'a>(points: usize, corners: &[u32], sets: impl Iterator<Item = &'a Vec<u32>>) -> Self {
        let mut numbers = corners.to_vec();
        for set in sets {
            let mut known = HashMap::with_capacity(points);
            for (number, &of_set) in numbers.iter_mut().zip(set) {
                let next = known.len() as u32;
                *number = *known.entry((*number, of_set)).or_insert(next);
            }
        }
        let mut found = HashMap::with_capacity(points);
        for (corner, &number) in numbers.iter().enumerate() {
            found.entry(number).or_insert(corner);
        }
        let mut is_used = vec![false; points];
        corners.iter().for_each(|&point| is_used[point as usize] = true);
        let alone = (0..points as u32).filter(|&point| !is_used[point as usize]).map(|point| (point, None));
        let split = found.into_values().map(|corner| (corners[corner], Some(corner)));
        let mut all: Vec<(u32, Option<usize>)> = split.chain(alone).collect();
        all.sort_unstable();
        let vertex_of = |(vertex, &(_, first)): (u32, &(u32, Option<usize>))| Some((numbers[first?], vertex));
        let vertex_of: HashMap<u32, u32> = (0..).zip(&all).filter_map(vertex_of).collect();
        let of_corners = numbers.iter().map(|number| vertex_of[number]).collect();
        let (vertices, firsts) = all.into_iter().unzip();
        Self { vertices, firsts, of_corners }
    }
}

/// What a corner of each vertex has; 0 where it has none.
fn at_vertices<T: Default>(firsts: &[Option<usize>], of_corner: impl Fn(usize) -> T) -> Vec<T> {
    firsts.iter().map(|first| first.map_or_else(T::default, &of_corner)).collect()
}

fn values<const N: usize>(
    set: &CornerSet<N>,
    firsts: &[Option<usize>],
    changed: impl Fn([f32; N]) -> [f32; N],
) -> Vec<[f32; N]>
where
    [f32; N]: Default,
{
    at_vertices(firsts, |corner| changed(set.values[set.corners[corner] as usize]))
}

/// Triangles of vertices by material, in the order in which these come.
fn primitives(faces: &Polygons, materials: &[u32], of_corners: &[u32]) -> Vec<(u32, Vec<[u32; 3]>)> {
    let (mut primitives, mut places, mut begin) = (Vec::new(), HashMap::new(), 0);
    for (face, &arity) in faces.arities().iter().enumerate() {
        let material = materials.get(face).copied().unwrap_or(NO_MATERIAL);
        let place = *places.entry(material).or_insert_with(|| {
            primitives.push((material, Vec::new()));
            primitives.len() - 1
        });
        let vertices = &of_corners[begin..begin + arity as usize];
        let fan = vertices.windows(2).skip(1).map(|pair| [vertices[0], pair[0], pair[1]]);
        primitives[place].1.extend(fan);
        begin += vertices.len();
    }
    primitives
}
