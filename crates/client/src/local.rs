//! Decoding cages to positions locally.

use crate::client::Client;
use crate::error::ClientError;
use crate::results::Coordinates;
use cager_core::cage::Cage;
use cager_core::coordinates::{CoordinateSystem, Green};
use cager_core::decode::Decoder;
use cager_core::inversion::BATCH;
use cager_geometry::mesh::TriMesh;
use cager_proto::messages::RestCage;

/// Decodes cages to positions locally, with the coordinates `Φ` fetched once.
///
/// The arithmetic is that of the service's decoder, so the measured errors apply to these positions.
#[derive(Clone, Debug)]
pub struct LocalDecoder {
    decoder: Decoder,
}

impl LocalDecoder {
    /// Fetches the coordinates of a session that is ready.
    ///
    /// # Errors
    /// [`ClientError::Refused`] where the session has none yet, and those of the connection.
    pub async fn fetch(client: &Client, id: &str) -> Result<Self, ClientError> {
        let session = client.session(id).await?;
        let coordinates = client.coordinates(id).await?;
        // Columns beyond the cage's vertices belong to face normals, as in Green coordinates.
        let positions = session.cage_vertices.map_or(coordinates.columns, |vertices| vertices as usize);
        let decoder = Self::new(&coordinates, positions)?;
        if session.unknowns.is_none_or(|unknowns| unknowns as usize == coordinates.columns) {
            return Ok(decoder);
        }
        decoder.with_tied_normals(&client.cage(id).await?)
    }

    /// A decoder for cages whose face normals are computed from their vertices, which is the case if a session has fewer unknowns than
    /// coordinates have columns.
    ///
    /// # Errors
    /// [`ClientError::Protocol`] where the cage is none, or does not fit the coordinates.
    pub fn with_tied_normals(self, cage: &RestCage) -> Result<Self, ClientError> {
        let mesh = TriMesh { vertices: cage.vertices.clone(), triangles: cage.faces.clone() };
        let cage = Cage::new(mesh).map_err(|error| ClientError::Protocol(error.to_string()))?;
        let values = Green::Consistent.values(&cage);
        let (vertices, columns) = (cage.vertices().len(), values.columns());
        if (self.decoder.positions(), self.decoder.columns()) != (vertices, columns) {
            let what = format!("coordinates of a cage of {vertices} vertices have {columns} columns");
            return Err(ClientError::Protocol(what));
        }
        Ok(Self { decoder: self.decoder.with_dependent_normals(values.dependent_normals) })
    }

    /// A decoder from coordinates whose first `positions` columns belong to vertices and whose other columns belong to further unknowns;
    /// see [`Self::with_tied_normals`] for computed normals.
    ///
    /// # Errors
    /// [`ClientError::Protocol`] where the numbers do not fit each other.
    pub fn new(coordinates: &Coordinates, positions: usize) -> Result<Self, ClientError> {
        let Coordinates { rows, columns, values } = coordinates;
        if rows.checked_mul(*columns) != Some(values.len()) || positions == 0 || positions > *columns {
            let what = format!("{rows} × {columns} coordinates of {positions} positions cannot be");
            return Err(ClientError::Protocol(what));
        }
        Ok(Self { decoder: Decoder::from_rows(values, *columns, positions) })
    }

    /// Points of the model, n.
    pub fn points(&self) -> usize {
        self.decoder.points()
    }

    /// Unknowns per frame, m.
    pub fn unknowns(&self) -> usize {
        self.decoder.unknowns()
    }

    /// Positions, n × 3 for each of the cages, which are m × 3 each. It uses all processors and blocks until it is done; some
    /// dozens of frames at a time are fastest.
    ///
    /// # Errors
    /// [`ClientError::Mismatch`] where a cage has another number of values.
    pub fn decode(&self, cages: &[&[f32]]) -> Result<Vec<Vec<f32>>, ClientError> {
        let expected = 3 * self.unknowns();
        if let Some(cage) = cages.iter().position(|cage| cage.len() != expected) {
            let found = cages[cage].len();
            return Err(ClientError::Mismatch(format!(
                "cage {cage} has {found} values where {expected} are expected; give cages of this session"
            )));
        }
        let mut positions = vec![Vec::new(); cages.len()];
        for (cages, out) in cages.chunks(BATCH).zip(positions.chunks_mut(BATCH)) {
            self.decoder.decode(cages, out);
        }
        Ok(positions)
    }
}
