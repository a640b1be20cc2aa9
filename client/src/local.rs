//! Positions from cages on the reader's own processors.

use crate::client::Client;
use crate::error::ClientError;
use crate::results::Coordinates;
use cager_core::decode::Decoder;
use cager_core::inversion::BATCH;

/// Turns cages into positions without asking the service for each: its coordinates `Φ` are fetched once.
///
/// The arithmetic is that of the service's own decoder, so the positions are those that its errors were measured on.
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
        // Unknowns beyond the cage's vertices are directions, as Green coordinates have them.
        let positions = session.cage_vertices.map_or(coordinates.columns, |vertices| vertices as usize);
        Self::new(&coordinates, positions)
    }

    /// A decoder from coordinates whose first `positions` unknowns are positions.
    ///
    /// # Errors
    /// [`ClientError::Protocol`] where the numbers do not fit each other.
    pub fn new(coordinates: &Coordinates, positions: usize) -> Result<Self, ClientError> {
        let Coordinates { rows, columns, values } = coordinates;
        if values.len() != rows * columns || positions == 0 || positions > *columns {
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
