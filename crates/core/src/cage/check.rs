//! Validation of a mesh as a cage: closed, edge-manifold, consistently and outwardly oriented, without degenerate faces.

use super::{Edge, Face, Nesting};
use crate::mesh::{Point, TriMesh};
use crate::vector::{cross, dot, norm, sub};
use std::collections::HashMap;
use std::fmt::Write;

/// Why a mesh cannot be a cage. Vertices and faces are counted from 0, in the order of the file.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum CageError {
    /// Fewer than four vertices or faces.
    #[error("the cage has {vertices} vertices and {faces} faces; a closed cage needs at least 4 of each")]
    TooSmall {
        /// Number of vertices.
        vertices: usize,
        /// Number of triangles.
        faces: usize,
    },
    /// NaN or infinity.
    #[error("cage vertex {vertex} is not finite; export the cage again or delete that vertex")]
    NotFinite {
        /// The vertex.
        vertex: usize,
    },
    /// A face names a vertex that does not exist.
    #[error("cage face {face} names vertex {vertex}, but there are only {vertices}; export the cage again")]
    NoSuchVertex {
        /// The face.
        face: usize,
        /// The index it names.
        vertex: u32,
        /// Number of vertices.
        vertices: usize,
    },
    /// A face without area.
    #[error("cage face {face} (vertices {v:?}) has no area; delete it or merge its vertices", v = .vertices)]
    Degenerate {
        /// The face.
        face: usize,
        /// Its corners.
        vertices: [u32; 3],
    },
    /// Two faces over the same three vertices.
    #[error("cage faces {first} and {second} have the same vertices {v:?}; delete one of them", v = .vertices)]
    DuplicateFaces {
        /// The earlier face.
        first: usize,
        /// The later face.
        second: usize,
        /// Their corners.
        vertices: [u32; 3],
    },
    /// More than two faces at one edge.
    #[error(
        "cage edge {a}–{b} is shared by {n} faces ({faces:?}) where a cage has 2 at every edge; separate or delete the extra faces",
        a = .edge[0], b = .edge[1], n = .faces.len()
    )]
    NonManifold {
        /// Ends of the edge.
        edge: [u32; 2],
        /// The faces that share it.
        faces: Vec<usize>,
    },
    /// Edges with a face on one side only.
    #[error("the cage is open: {} with a face on one side only ({}); fill the holes or merge doubled vertices", edge_count(.edges.len()), list_edges(.edges))]
    Open {
        /// Every boundary edge.
        edges: Vec<[u32; 2]>,
    },
    /// Two neighbouring faces wind in opposite directions.
    #[error(
        "cage faces {} and {} run along edge {}–{} in the same direction, so one of them is inside out; recalculate the cage's normals",
        .faces[0], .faces[1], .edge[0], .edge[1]
    )]
    Inconsistent {
        /// The two faces.
        faces: [usize; 2],
        /// Their common edge.
        edge: [u32; 2],
    },
    /// All faces point inwards.
    #[error("all {faces} faces of the cage point inwards (signed volume {volume:.3e}); flip them")]
    Inward {
        /// Number of faces.
        faces: usize,
        /// Signed volume, negative.
        volume: f64,
    },
    /// One of several shells points inwards and is not a cavity.
    #[error("the part of the cage with vertex {vertex} points inwards while others point outwards; flip that part")]
    InwardPart {
        /// A vertex of the part.
        vertex: u32,
    },
    /// A vertex that no face uses.
    #[error("cage vertex {vertex} belongs to no face, so nothing would place it; delete loose vertices")]
    LooseVertex {
        /// The vertex.
        vertex: usize,
    },
}

impl CageError {
    /// The same error with faces counted as in the file, before polygons were split into triangles.
    #[must_use]
    pub fn renumbered(mut self, face_of: impl Fn(usize) -> usize) -> Self {
        match &mut self {
            Self::NoSuchVertex { face, .. } | Self::Degenerate { face, .. } => *face = face_of(*face),
            Self::DuplicateFaces { first, second, .. } => (*first, *second) = (face_of(*first), face_of(*second)),
            Self::NonManifold { faces, .. } => faces.iter_mut().for_each(|face| *face = face_of(*face)),
            Self::Inconsistent { faces, .. } => *faces = faces.map(face_of),
            _ => {}
        }
        self
    }
}

fn edge_count(n: usize) -> String {
    if n == 1 { "1 edge".to_owned() } else { format!("{n} edges") }
}

fn list_edges(edges: &[[u32; 2]]) -> String {
    const SHOWN: usize = 6;
    let mut text = String::new();
    for (k, [a, b]) in edges.iter().take(SHOWN).enumerate() {
        let _ = write!(text, "{}{a}–{b}", if k == 0 { "" } else { ", " });
    }
    if edges.len() > SHOWN {
        text.push_str(", …");
    }
    text
}

/// A face whose height is below this fraction of its longest edge has no usable normal.
const FLAT: f64 = 1e-12;

pub(super) fn connect(mesh: &TriMesh) -> Result<(Vec<Edge>, Vec<Face>), CageError> {
    let n = mesh.vertices.len();
    if n < 4 || mesh.triangles.len() < 4 {
        return Err(CageError::TooSmall { vertices: n, faces: mesh.triangles.len() });
    }
    if let Some(vertex) = mesh.vertices.iter().position(|p| p.iter().any(|c| !c.is_finite())) {
        return Err(CageError::NotFinite { vertex });
    }
    check_faces(mesh)?;

    let mut sides: HashMap<[u32; 2], usize> = HashMap::with_capacity(mesh.triangles.len() * 2);
    let mut edges: Vec<Edge> = Vec::new();
    let mut users: Vec<Vec<(usize, bool)>> = Vec::new();
    let mut faces = Vec::with_capacity(mesh.triangles.len());
    for (f, &vertices) in mesh.triangles.iter().enumerate() {
        let mut face = Face { vertices, edges: [0; 3], signs: [1.0; 3] };
        for i in 0..3 {
            let (a, b) = (vertices[(i + 1) % 3], vertices[(i + 2) % 3]);
            let key = [a.min(b), a.max(b)];
            let edge = *sides.entry(key).or_insert_with(|| {
                edges.push(Edge { vertices: key });
                users.push(Vec::new());
                edges.len() - 1
            });
            users[edge].push((f, a < b));
            face.edges[i] = edge as u32;
            face.signs[i] = if a < b { 1.0 } else { -1.0 };
        }
        faces.push(face);
    }
    check_edges(&edges, &users)?;
    Ok((edges, faces))
}

fn check_faces(mesh: &TriMesh) -> Result<(), CageError> {
    let n = mesh.vertices.len();
    let mut seen: HashMap<[u32; 3], usize> = HashMap::with_capacity(mesh.triangles.len());
    let mut used = vec![false; n];
    for (face, &vertices) in mesh.triangles.iter().enumerate() {
        if let Some(&vertex) = vertices.iter().find(|&&v| v as usize >= n) {
            return Err(CageError::NoSuchVertex { face, vertex, vertices: n });
        }
        if is_flat(vertices.map(|v| mesh.vertices[v as usize])) {
            return Err(CageError::Degenerate { face, vertices });
        }
        let mut key = vertices;
        key.sort_unstable();
        if let Some(&first) = seen.get(&key) {
            return Err(CageError::DuplicateFaces { first, second: face, vertices });
        }
        seen.insert(key, face);
        for v in vertices {
            used[v as usize] = true;
        }
    }
    match used.iter().position(|u| !u) {
        Some(vertex) => Err(CageError::LooseVertex { vertex }),
        None => Ok(()),
    }
}

fn is_flat([a, b, c]: [Point; 3]) -> bool {
    let (u, v, w) = (sub(b, a), sub(c, a), sub(c, b));
    let longest2 = dot(u, u).max(dot(v, v)).max(dot(w, w));
    let height = norm(cross(u, v)) / longest2;
    // NaN, from coordinates that overflow, counts as flat.
    height.is_nan() || height <= FLAT
}

fn check_edges(edges: &[Edge], users: &[Vec<(usize, bool)>]) -> Result<(), CageError> {
    for (edge, users) in edges.iter().zip(users) {
        if users.len() > 2 {
            return Err(CageError::NonManifold { edge: edge.vertices, faces: users.iter().map(|u| u.0).collect() });
        }
    }
    let open: Vec<_> = edges.iter().zip(users).filter(|(_, u)| u.len() == 1).map(|(e, _)| e.vertices).collect();
    if !open.is_empty() {
        return Err(CageError::Open { edges: open });
    }
    for (edge, users) in edges.iter().zip(users) {
        if users[0].1 == users[1].1 {
            return Err(CageError::Inconsistent { faces: [users[0].0, users[1].0], edge: edge.vertices });
        }
    }
    Ok(())
}

/// Every shell must enclose a positive volume, except cavities inside another shell.
pub(super) fn check_orientation(mesh: &TriMesh, faces: &[Face], edges: usize) -> Result<(), CageError> {
    let (shell_of, starts) = shells(faces, edges);
    let volumes = volumes(mesh, &shell_of, &starts);
    if volumes.iter().all(|&v| v <= 0.0) {
        return Err(CageError::Inward { faces: faces.len(), volume: volumes.iter().sum() });
    }
    if volumes.iter().all(|&v| v > 0.0) {
        return Ok(());
    }
    let nesting = Nesting::new(&mesh.vertices, &mesh.triangles, &shell_of);
    let is_sound = |shell: usize| volumes[shell] > 0.0 || nesting.is_enclosed(shell as u32, |_| 1);
    match (0..starts.len()).find(|&shell| !is_sound(shell)) {
        Some(shell) => Err(CageError::InwardPart { vertex: mesh.triangles[starts[shell]][0] }),
        None => Ok(()),
    }
}

/// The connected component over edges that each face belongs to, and the first face of each.
fn shells(faces: &[Face], edges: usize) -> (Vec<u32>, Vec<usize>) {
    let mut at_edge = vec![Vec::new(); edges];
    for (f, face) in faces.iter().enumerate() {
        for e in face.edges {
            at_edge[e as usize].push(f);
        }
    }
    let mut shell_of = vec![u32::MAX; faces.len()];
    let mut starts = Vec::new();
    for start in 0..faces.len() {
        if shell_of[start] != u32::MAX {
            continue;
        }
        let shell = starts.len() as u32;
        shell_of[start] = shell;
        starts.push(start);
        let mut waiting = vec![start];
        while let Some(face) = waiting.pop() {
            for &f in faces[face].edges.iter().flat_map(|&e| &at_edge[e as usize]) {
                if shell_of[f] == u32::MAX {
                    shell_of[f] = shell;
                    waiting.push(f);
                }
            }
        }
    }
    (shell_of, starts)
}

/// Signed volumes of the shells.
fn volumes(mesh: &TriMesh, shell_of: &[u32], starts: &[usize]) -> Vec<f64> {
    let mut volumes = vec![0.0; starts.len()];
    for (triangle, &shell) in mesh.triangles.iter().zip(shell_of) {
        // Relative to a vertex of the shell, so that a cage far from the origin keeps its digits.
        let o = mesh.vertices[mesh.triangles[starts[shell as usize]][0] as usize];
        let [a, b, c] = triangle.map(|v| sub(mesh.vertices[v as usize], o));
        volumes[shell as usize] += dot(a, cross(b, c)) / 6.0;
    }
    volumes
}
