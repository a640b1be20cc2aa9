//! A validated cage: a closed, outward-oriented triangle mesh with its edges.

mod defects;
mod error;

pub use defects::Defects;
pub use error::CageError;

use cager_geometry::mesh::{Point, TriMesh, diagonal};
use defects::Examination;

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
    /// +1 where the face traverses the edge from the smaller vertex index to the larger, −1 where it traverses it in the opposite direction.
    pub signs: [f64; 3],
}

/// A closed, outward-oriented triangle mesh around a model.
#[derive(Clone, Debug)]
pub struct Cage {
    mesh: TriMesh,
    edges: Vec<Edge>,
    faces: Vec<Face>,
    diagonal: f64,
}

impl Cage {
    /// Validates a mesh as a cage.
    ///
    /// # Errors
    /// The first of the mesh's [`Defects`].
    pub fn new(mesh: TriMesh) -> Result<Self, CageError> {
        let Examination { defects, edges, faces } = Examination::of(&mesh);
        match defects.first(&mesh) {
            Some(error) => Err(error),
            None => Ok(Self { diagonal: diagonal(&mesh.vertices), mesh, edges, faces }),
        }
    }

    /// Vertices, v × 3.
    pub fn vertices(&self) -> &[Point] {
        &self.mesh.vertices
    }

    /// The mesh as it was given.
    pub fn mesh(&self) -> &TriMesh {
        &self.mesh
    }

    /// Edges, in the order in which the faces first refer to them.
    pub fn edges(&self) -> &[Edge] {
        &self.edges
    }

    /// Faces with their edges, in the mesh's order.
    pub fn faces(&self) -> &[Face] {
        &self.faces
    }

    /// Diagonal of the bounding box.
    pub fn diagonal(&self) -> f64 {
        self.diagonal
    }
}
