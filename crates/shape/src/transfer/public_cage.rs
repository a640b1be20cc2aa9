//! Public cages: one around source and target, in the target's space (the second paper, §3.2).

use cager_cages::{BoundingShape, EncloseError, EncloseOptions, bounding_shape, enclose_watched};
use cager_geometry::mesh::{Model, TriMesh};
use std::ops::ControlFlow;

/// The shape of a public cage.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PublicCage {
    /// The bounding box, 8 vertices.
    Box,
    /// An icosahedron, 12 vertices.
    Icosahedron,
    /// A geodesic sphere of at most so many vertices: 42, 162.
    Sphere(usize),
    /// The convex hull, simplified to at most so many vertices and enlarged.
    Hull(usize),
    /// An offset surface of both, simplified to at most so many vertices.
    Offset(usize),
}

impl PublicCage {
    /// The cage around both.
    ///
    /// # Errors
    /// Models without extent or with coordinates that are not finite, and too few vertices.
    pub fn around(self, source: &TriMesh, target: &TriMesh) -> Result<TriMesh, EncloseError> {
        self.around_watched(source, target, &mut || ControlFlow::Continue(()))
    }

    /// [`Self::around`], given up once `watch` breaks, which offset surfaces call.
    ///
    /// # Errors
    /// As [`Self::around`].
    pub fn around_watched(
        self,
        source: &TriMesh,
        target: &TriMesh,
        watch: &mut dyn FnMut() -> ControlFlow<()>,
    ) -> Result<TriMesh, EncloseError> {
        let models = [Model::from(source.clone()), Model::from(target.clone())];
        let bounding = |shape, vertices| bounding_shape(&[&models[0], &models[1]], shape, vertices);
        match self {
            Self::Box => bounding(BoundingShape::Box, 8),
            Self::Icosahedron => bounding(BoundingShape::Sphere, 12),
            Self::Sphere(vertices) => bounding(BoundingShape::Sphere, vertices),
            Self::Hull(vertices) => bounding(BoundingShape::Hull, vertices),
            Self::Offset(vertices) => {
                enclose_watched(&joined(source, target), &EncloseOptions { vertices, ..Default::default() }, watch)
            }
        }
    }
}

fn joined(source: &TriMesh, target: &TriMesh) -> Model {
    let first = source.vertices.len() as u32;
    let mut both = Model::from(source.clone());
    both.points.extend(&target.vertices);
    target.triangles.iter().for_each(|t| both.faces.push(&t.map(|v| v + first)));
    both
}
