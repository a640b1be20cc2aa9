//! What a file of a mesh gave.

use cager_geometry::mesh::Model;
use cager_geometry::units::Units;

use crate::dropped::Dropped;

/// What a file gave.
pub(super) struct Parsed {
    pub(super) model: Model,
    /// Faces of fewer than three corners, which are edges and points.
    pub(super) left_out: usize,
    pub(super) units: Units,
    /// Files of materials that it names.
    pub(super) libraries: Vec<String>,
    /// What else the file has.
    pub(super) dropped: Dropped,
}

impl Parsed {
    /// Of glTF, which is in metres with Y up.
    pub(super) fn of_gltf((model, dropped): (Model, Dropped)) -> Self {
        Self { units: Units::METRES, dropped, ..Self::from(model) }
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
        Self { model, left_out: 0, units: Units::UNKNOWN, libraries: Vec::new(), dropped: Dropped::default() }
    }
}
