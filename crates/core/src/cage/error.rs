//! Why a mesh cannot be a cage.

use std::fmt::Write;

/// Why a mesh cannot be a cage. Vertices and faces are counted from 0, in the order of the file.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[allow(missing_docs)]
pub enum CageError {
    #[error("the cage has {vertices} vertices and {faces} faces; a closed cage needs at least 4 of each")]
    TooSmall { vertices: usize, faces: usize },
    #[error("cage vertex {vertex} is not finite; export the cage again or delete that vertex")]
    NotFinite { vertex: usize },
    #[error("cage face {face} names vertex {vertex}, but there are only {vertices}; export the cage again")]
    NoSuchVertex { face: usize, vertex: u32, vertices: usize },
    #[error("cage face {face} (vertices {v:?}) has no area; delete it or merge its vertices", v = .vertices)]
    Degenerate { face: usize, vertices: [u32; 3] },
    #[error("cage faces {first} and {second} have the same vertices {v:?}; delete one of them", v = .vertices)]
    DuplicateFaces { first: usize, second: usize, vertices: [u32; 3] },
    #[error(
        "cage edge {a}–{b} is shared by {n} faces ({faces:?}) where a cage has 2 at every edge; separate or delete the extra faces",
        a = .edge[0], b = .edge[1], n = .faces.len()
    )]
    NonManifold { edge: [u32; 2], faces: Vec<usize> },
    #[error("the cage is open: {} with a face on one side only ({}); fill the holes or merge doubled vertices", edge_count(.edges.len()), list_edges(.edges))]
    Open { edges: Vec<[u32; 2]> },
    #[error(
        "cage faces {} and {} run along edge {}–{} in the same direction, so one of them is inside out; recalculate the cage's normals",
        .faces[0], .faces[1], .edge[0], .edge[1]
    )]
    Inconsistent { faces: [usize; 2], edge: [u32; 2] },
    #[error("all {faces} faces of the cage point inwards (signed volume {volume:.3e}); flip them")]
    Inward { faces: usize, volume: f64 },
    /// One of several shells points inwards and is not a cavity.
    #[error("the part of the cage with vertex {vertex} points inwards while others point outwards; flip that part")]
    InwardPart { vertex: u32 },
    #[error("cage vertex {vertex} belongs to no face, so nothing would place it; delete loose vertices")]
    LooseVertex { vertex: usize },
    #[error("the components of the cage do not fit the points that they carry: {what}")]
    Carriers { what: String },
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
