//! A mesh at rest: its polygons, and its positions on a grid.

use crate::connectivity::{decode_faces, encode_faces};
use crate::error::{Error, Result};
use crate::grid::{Grid, decode_positions, encode_positions};
use cager_core::mesh::Model;

/// A mesh as bytes, and what they decode to: the same vertices and polygons, the polygons in another order.
#[derive(Clone, Debug)]
pub struct CodedMesh {
    /// What the bytes decode to.
    pub mesh: Model,
    /// The polygons, [`encode_faces`].
    pub faces: Vec<u8>,
    /// The positions, [`encode_positions`].
    pub positions: Vec<u8>,
}

impl CodedMesh {
    /// Of a mesh, positions in steps of `step`.
    ///
    /// # Errors
    /// No points, or positions too far apart to be counted in these steps.
    pub fn new(mesh: &Model, step: f64) -> Result<Self> {
        let points = mesh.points.len();
        let grid = Grid::new(&mesh.points, step).ok_or(Error::Damaged("positions too far apart for this step"))?;
        let faces = encode_faces(&mesh.faces, points);
        let ordered = decode_faces(&faces, points, mesh.faces.len(), mesh.faces.indices().len())?;
        let positions = encode_positions(grid, &ordered, &mesh.points);
        let points = decode_positions(&positions, &ordered, points)?;
        Ok(Self { mesh: Model { points, faces: ordered, colors: mesh.colors.clone() }, faces, positions })
    }

    /// Bytes that its polygons and positions take; colours are not coded.
    pub fn bytes(&self) -> usize {
        self.faces.len() + self.positions.len()
    }
}
