//! Why a mesh cannot be a cage.

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
