//! What a file of a mesh gave.

use crate::error::Fault;
use cager_geometry::mesh::Model;
use cager_geometry::units::Units;

/// How much of a file is wanted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Contents {
    PointsAndFaces,
    Points,
}

/// What a file gave.
pub(super) struct Parsed {
    pub(super) model: Model,
    /// Faces of fewer than three corners, which are edges and points.
    pub(super) left_out: usize,
    pub(super) units: Units,
}

impl Parsed {
    /// Of glTF, which is in metres with Y up.
    pub(super) fn of_gltf(model: Model) -> Self {
        Self { units: Units::METRES, ..Self::from(model) }
    }

    /// Faces tell the normals of a mesh.
    pub(super) fn without_mesh_normals(mut self) -> Self {
        if !self.model.faces.is_empty() {
            self.model.normals = Vec::new();
        }
        self
    }
}

impl From<Model> for Parsed {
    fn from(model: Model) -> Self {
        Self { model, left_out: 0, units: Units::UNKNOWN }
    }
}

/// Checks the corners of one face, which `place` names in messages, against the number of points.
pub(crate) fn check_face(corners: &[u32], points: usize, place: impl Fn() -> String) -> Result<(), Fault> {
    match corners.iter().find(|&&index| index as usize >= points) {
        Some(&index) => Err(no_such_vertex(&place(), index.into(), points)),
        None => Ok(()),
    }
}

pub(super) fn no_such_vertex(place: &str, index: i64, points: usize) -> Fault {
    Fault::invalid(format!(
        "{place}: the face names vertex {index}, but there are {points} vertices; export the mesh again"
    ))
}
