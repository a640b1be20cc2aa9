//! Splits and collapses of a closed triangle mesh's edges.

use cager_core::cage::Cage;
use cager_geometry::mesh::TriMesh;
use cager_geometry::topology::{faces_around, ring};
use cager_geometry::vector;
use glam::DVec3;

/// What is around the vertices of a closed triangle mesh.
pub(super) struct OneRings<'a> {
    triangles: &'a [[u32; 3]],
    faces: Vec<Vec<u32>>,
}

impl<'a> OneRings<'a> {
    pub(super) fn new(mesh: &'a TriMesh) -> Self {
        Self { faces: faces_around(mesh.vertices.len(), &mesh.triangles), triangles: &mesh.triangles }
    }

    /// Vertices that share an edge with `v`, ascending.
    pub(super) fn of(&self, v: usize) -> Vec<u32> {
        ring(v as u32, self.faces(v), self.triangles)
    }

    /// Faces around `v`.
    pub(super) fn faces(&self, v: usize) -> &[u32] {
        &self.faces[v]
    }
}

/// Every face in four, with vertices at the middles of edges after the cage's own, in edge order.
pub(super) fn subdivided(cage: &Cage) -> TriMesh {
    let m = cage.vertices().len() as u32;
    let at = |v: u32| cage.vertices()[v as usize];
    let middles = cage.edges().iter().map(|e| vector::middle(at(e.vertices[0]), at(e.vertices[1])));
    let vertices = cage.vertices().iter().copied().chain(middles).collect();
    let mut triangles = Vec::with_capacity(4 * cage.faces().len());
    for face in cage.faces() {
        let [a, b, c] = face.vertices;
        // `edges[i]` is opposite corner i.
        let [bc, ca, ab] = face.edges.map(|e| m + e);
        triangles.extend([[a, ab, ca], [b, bc, ab], [c, ca, bc], [ab, bc, ca]]);
    }
    TriMesh { vertices, triangles }
}

/// Puts a vertex at the middle of the edge between `a` and `b`.
pub(super) fn split(mesh: &mut TriMesh, [a, b]: [u32; 2]) {
    let new = mesh.vertices.len() as u32;
    mesh.vertices.push(vector::middle(mesh.vertices[a as usize], mesh.vertices[b as usize]));
    for f in 0..mesh.triangles.len() {
        let triangle = mesh.triangles[f];
        if triangle.contains(&a) && triangle.contains(&b) {
            mesh.triangles[f] = triangle.map(|v| if v == a { new } else { v });
            mesh.triangles.push(triangle.map(|v| if v == b { new } else { v }));
        }
    }
}

/// Whether merging `v` into `into` keeps the topology: they have exactly two common neighbours.
fn is_collapsible(neighbours: &OneRings<'_>, v: usize, into: usize) -> bool {
    let (one, other) = (neighbours.of(v), neighbours.of(into));
    let common = one.iter().filter(|w| other.binary_search(w).is_ok()).count();
    common == 2 && one.len() + other.len() > 7 && neighbours.triangles.len() > 4
}

/// Merging a vertex into a neighbour.
pub(super) struct Collapse {
    /// The neighbour that stays.
    pub(super) into: u32,
    /// Faces around the vertex.
    pub(super) old: Vec<[u32; 3]>,
    /// Faces in their place.
    pub(super) new: Vec<[u32; 3]>,
    /// Quality of the worst new face, from its shape and the rotation of its normal; at most 1.3.
    quality: f64,
}

/// Collapses of `v` that keep the surface's topology and leave usable faces, the best first.
pub(super) fn collapses(mesh: &TriMesh, neighbours: &OneRings<'_>, v: usize) -> Vec<Collapse> {
    let at = |w: u32| DVec3::from_array(mesh.vertices[w as usize]);
    let normal = |t: [u32; 3]| (at(t[1]) - at(t[0])).cross(at(t[2]) - at(t[0]));
    let old: Vec<[u32; 3]> = neighbours.faces(v).iter().map(|&f| mesh.triangles[f as usize]).collect();
    let mut found = Vec::new();
    for into in neighbours.of(v) {
        if !is_collapsible(neighbours, v, into as usize) {
            continue;
        }
        let mut quality = f64::INFINITY;
        let mut new = Vec::new();
        for &face in old.iter().filter(|face| !face.contains(&into)) {
            let moved = face.map(|w| if w as usize == v { into } else { w });
            let (n, o) = (normal(moved), normal(face));
            let longest = (0..3).map(|i| at(moved[i]).distance_squared(at(moved[(i + 1) % 3]))).fold(0.0, f64::max);
            let shape = n.length() / longest.max(f64::MIN_POSITIVE);
            let turn = n.dot(o) / (n.length() * o.length()).max(f64::MIN_POSITIVE);
            quality = quality.min(shape * (turn + 0.3));
            new.push(moved);
        }
        if quality > 0.02 {
            found.push(Collapse { into, old: old.clone(), new, quality });
        }
    }
    found.sort_by(|a, b| b.quality.total_cmp(&a.quality));
    found
}

/// Merges vertices, `(v, into)`, none of which shares a neighbour with another; returns the new
/// mesh and which vertex each of its vertices was.
pub(super) fn merged(mesh: &TriMesh, pairs: &[(u32, u32)]) -> (TriMesh, Vec<u32>) {
    let mut target: Vec<u32> = (0..mesh.vertices.len() as u32).collect();
    for &(v, into) in pairs {
        target[v as usize] = into;
    }
    let mut new = vec![u32::MAX; mesh.vertices.len()];
    let mut kept = Vec::new();
    for v in 0..mesh.vertices.len() {
        if target[v] as usize == v {
            new[v] = kept.len() as u32;
            kept.push(v as u32);
        }
    }
    let triangles = mesh
        .triangles
        .iter()
        .map(|t| t.map(|v| new[target[v as usize] as usize]))
        .filter(|t| t[0] != t[1] && t[1] != t[2] && t[2] != t[0])
        .collect();
    (TriMesh { vertices: kept.iter().map(|&v| mesh.vertices[v as usize]).collect(), triangles }, kept)
}
