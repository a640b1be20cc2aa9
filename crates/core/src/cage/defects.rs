//! All that keeps a triangle mesh from being a cage, and its edges.

use super::error::CageError;
use cager_geometry::mesh::{Point, TriMesh};
use cager_geometry::spatial::{Nesting, part_volumes};
use cager_geometry::topology::UnionFind;
use cager_geometry::vector::{cross, dot, norm, sub};
use std::collections::HashMap;

/// An edge of a cage, shared by exactly two faces.
#[derive(Clone, Copy, Debug)]
pub struct Edge {
    /// Its ends, the smaller index first.
    pub vertices: [u32; 2],
    /// The faces at it, in the mesh's order.
    pub faces: [u32; 2],
}

/// A face of a cage with its edges.
#[derive(Clone, Copy, Debug)]
pub struct Face {
    /// Corners, counter-clockwise seen from outside.
    pub vertices: [u32; 3],
    /// `edges[i]` is the edge opposite corner i.
    pub edges: [u32; 3],
    /// +1 where the face runs along the edge from the smaller vertex index, −1 otherwise.
    pub signs: [f64; 3],
}

/// A face whose height is below this fraction of its longest edge has no usable normal.
const FLAT: f64 = 1e-12;

/// What keeps a mesh from being a closed, edge-manifold, consistently and outwardly oriented cage.
/// Vertices and faces are counted from 0; lists ascend, pairs by their second entry.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Defects {
    /// Vertices with coordinates that are NaN or infinite.
    pub not_finite: Vec<u32>,
    /// Faces that name vertices that do not exist.
    pub dangling_faces: Vec<u32>,
    /// Faces without area.
    pub degenerate_faces: Vec<u32>,
    /// Pairs of faces over the same vertices, each with the first of them.
    pub duplicate_faces: Vec<[u32; 2]>,
    /// Vertices that no face uses.
    pub loose_vertices: Vec<u32>,
    /// Edges with one face only.
    pub open_edges: Vec<[u32; 2]>,
    /// Edges with more than two faces.
    pub non_manifold_edges: Vec<[u32; 2]>,
    /// Edges along which two faces run in the same direction.
    pub inconsistent_edges: Vec<[u32; 2]>,
    /// Connected parts of the surface.
    pub components: usize,
    /// Parts that point inwards inside another; like the next, not of defective edges or points.
    pub cavities: usize,
    /// Parts that point inwards without being a cavity, each by its first face.
    pub inward_parts: Vec<u32>,
    /// Whether all parts point inwards, and the sum of their signed volumes.
    all_inwards: bool,
    volume: f64,
}

/// The faces at an edge, each with whether it runs from the smaller to the larger vertex.
type FacesAtEdge = Vec<(u32, bool)>;

/// A mesh's defects, and its faces whose vertices exist, with their edges.
pub(super) struct Examination {
    pub(super) defects: Defects,
    /// In the order in which the faces first refer to them; complete only where edges are sound.
    pub(super) edges: Vec<Edge>,
    pub(super) faces: Vec<Face>,
}

impl Defects {
    /// Those of a mesh, and why it cannot be a cage, if that is so.
    pub fn of(mesh: &TriMesh) -> (Self, Option<CageError>) {
        let defects = Examination::of(mesh).defects;
        let refusal = defects.first(mesh);
        (defects, refusal)
    }

    /// The first that is worth mending; `mesh` is the one that was examined.
    pub(super) fn first(&self, mesh: &TriMesh) -> Option<CageError> {
        let (vertices, faces) = (mesh.vertices.len(), mesh.triangles.len());
        if vertices < 4 || faces < 4 {
            return Some(CageError::TooSmall { vertices, faces });
        }
        if let Some(&vertex) = self.not_finite.first() {
            return Some(CageError::NotFinite { vertex: vertex as usize });
        }
        let corners = |face: u32| mesh.triangles[face as usize];
        let dangling = self.dangling_faces.first().map(|&face| {
            let vertex = corners(face).into_iter().find(|&v| v as usize >= vertices).unwrap_or_default();
            (face, CageError::NoSuchVertex { face: face as usize, vertex, vertices })
        });
        let degenerate = self
            .degenerate_faces
            .first()
            .map(|&face| (face, CageError::Degenerate { face: face as usize, vertices: corners(face) }));
        let duplicate = self.duplicate_faces.first().map(|&[first, second]| {
            let vertices = corners(second);
            (second, CageError::DuplicateFaces { first: first as usize, second: second as usize, vertices })
        });
        let of_faces = [dangling, degenerate, duplicate].into_iter().flatten().min_by_key(|(face, _)| *face);
        if let Some((_, error)) = of_faces {
            return Some(error);
        }
        if let Some(&vertex) = self.loose_vertices.first() {
            return Some(CageError::LooseVertex { vertex: vertex as usize });
        }
        let faces_at = |edge: [u32; 2]| {
            let has = |face: &usize| edge.iter().all(|v| mesh.triangles[*face].contains(v));
            (0..faces).filter(has).collect::<Vec<usize>>()
        };
        if let Some(&edge) = self.non_manifold_edges.first() {
            return Some(CageError::NonManifold { edge, faces: faces_at(edge) });
        }
        if !self.open_edges.is_empty() {
            return Some(CageError::Open { edges: self.open_edges.clone() });
        }
        if let Some(&edge) = self.inconsistent_edges.first() {
            let found = faces_at(edge);
            return Some(CageError::Inconsistent { faces: [found[0], found[1]], edge });
        }
        if self.all_inwards {
            return Some(CageError::Inward { faces, volume: self.volume });
        }
        let face = *self.inward_parts.first()?;
        Some(CageError::InwardPart { vertex: corners(face)[0] })
    }
}

impl Examination {
    pub(super) fn of(mesh: &TriMesh) -> Self {
        let vertices = mesh.vertices.len();
        let is_finite = |v: &u32| mesh.vertices[*v as usize].iter().all(|x| x.is_finite());
        let not_finite = (0..vertices as u32).filter(|v| !is_finite(v)).collect();
        let mut defects = Defects { not_finite, ..Defects::default() };
        let names = defects.examine_faces(mesh);

        let mut edge_of: HashMap<[u32; 2], u32> = HashMap::with_capacity(mesh.triangles.len() * 2);
        let mut edges: Vec<([u32; 2], FacesAtEdge)> = Vec::new();
        let mut faces = Vec::with_capacity(names.len());
        for (f, &name) in names.iter().enumerate() {
            let corners = mesh.triangles[name as usize];
            let mut face = Face { vertices: corners, edges: [0; 3], signs: [1.0; 3] };
            for i in 0..3 {
                let (a, b) = (corners[(i + 1) % 3], corners[(i + 2) % 3]);
                let key = [a.min(b), a.max(b)];
                let edge = *edge_of.entry(key).or_insert_with(|| {
                    edges.push((key, Vec::with_capacity(2)));
                    edges.len() as u32 - 1
                });
                edges[edge as usize].1.push((f as u32, a < b));
                face.edges[i] = edge;
                face.signs[i] = if a < b { 1.0 } else { -1.0 };
            }
            faces.push(face);
        }
        let mut shells = UnionFind::new(faces.len());
        let mut kept = Vec::with_capacity(edges.len());
        for (edge, users) in edges {
            match users[..] {
                [_] => defects.open_edges.push(edge),
                [(f, one), (g, other)] => {
                    if one == other {
                        defects.inconsistent_edges.push(edge);
                    }
                    shells.join(f, g);
                    kept.push(Edge { vertices: edge, faces: [f, g] });
                }
                _ => defects.non_manifold_edges.push(edge),
            }
        }
        for list in [&mut defects.open_edges, &mut defects.inconsistent_edges, &mut defects.non_manifold_edges] {
            list.sort_unstable();
        }
        let (labels, count) = shells.numbered();
        defects.components = count as usize;
        defects.examine_orientation(mesh, &names, &labels);
        Self { defects, edges: kept, faces }
    }
}

impl Defects {
    /// Names of the faces whose vertices exist.
    fn examine_faces(&mut self, mesh: &TriMesh) -> Vec<u32> {
        let mut used = vec![false; mesh.vertices.len()];
        let mut seen: HashMap<[u32; 3], u32> = HashMap::with_capacity(mesh.triangles.len());
        let mut names = Vec::with_capacity(mesh.triangles.len());
        for (name, &face) in (0..).zip(&mesh.triangles) {
            if face.iter().any(|&v| v as usize >= used.len()) {
                self.dangling_faces.push(name);
                continue;
            }
            names.push(name);
            face.iter().for_each(|&v| used[v as usize] = true);
            if is_flat(face.map(|v| mesh.vertices[v as usize])) {
                self.degenerate_faces.push(name);
            }
            let mut key = face;
            key.sort_unstable();
            match seen.get(&key) {
                Some(&first) => self.duplicate_faces.push([first, name]),
                None => {
                    seen.insert(key, name);
                }
            }
        }
        self.loose_vertices = (0..used.len() as u32).filter(|&v| !used[v as usize]).collect();
        names
    }

    /// Every part must enclose a positive volume, except cavities inside another part.
    fn examine_orientation(&mut self, mesh: &TriMesh, names: &[u32], labels: &[u32]) {
        let is_examined = self.open_edges.is_empty()
            && self.inconsistent_edges.is_empty()
            && self.non_manifold_edges.is_empty()
            && self.not_finite.is_empty();
        if !is_examined {
            return;
        }
        let faces: Vec<[u32; 3]> = names.iter().map(|&f| mesh.triangles[f as usize]).collect();
        let volumes = part_volumes(&mesh.vertices, &faces, labels);
        self.volume = volumes.iter().sum();
        let inwards: Vec<u32> = (0..volumes.len() as u32).filter(|&part| is_inwards(volumes[part as usize])).collect();
        self.all_inwards = !volumes.is_empty() && volumes.iter().all(|&volume| volume <= 0.0);
        if inwards.is_empty() {
            return;
        }
        let nesting = Nesting::new(&mesh.vertices, &faces, labels);
        for part in inwards {
            if nesting.is_enclosed(part, |_| 1) {
                self.cavities += 1;
            } else {
                self.inward_parts.push(names[nesting.first_face(part) as usize]);
            }
        }
    }
}

/// NaN, from coordinates whose products overflow, is no volume either.
fn is_inwards(volume: f64) -> bool {
    volume.is_nan() || volume <= 0.0
}

fn is_flat([a, b, c]: [Point; 3]) -> bool {
    let (u, v, w) = (sub(b, a), sub(c, a), sub(c, b));
    let longest2 = dot(u, u).max(dot(v, v)).max(dot(w, w));
    let height = norm(cross(u, v)) / longest2;
    // NaN, from coordinates that overflow, counts as flat.
    height.is_nan() || height <= FLAT
}
