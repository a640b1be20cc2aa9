//! A validated cage: a closed, outward-oriented triangle mesh with its edges.

mod carriers;
mod defects;
mod error;

pub use carriers::Carrier;
pub(crate) use carriers::Component;
pub use defects::{Defects, Edge, Face};
pub use error::CageError;

use cager_geometry::mesh::{Point, TriMesh, diagonal};
use defects::Examination;
use std::ops::Range;

/// A closed, outward-oriented triangle mesh around a model.
#[derive(Clone, Debug)]
pub struct Cage {
    mesh: TriMesh,
    edges: Vec<Edge>,
    faces: Vec<Face>,
    diagonal: f64,
    /// Vertices of each component, ascending; none where the whole cage carries every point.
    components: Vec<Range<u32>>,
    carriers: Vec<Carrier>,
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
            None => Ok(Self {
                diagonal: diagonal(&mesh.vertices),
                mesh,
                edges,
                faces,
                components: Vec::new(),
                carriers: Vec::new(),
            }),
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
