//! The cage that shapes between poses are found on, where none is given.

use cager_cages::{EncloseError, EncloseOptions, enclose};
use cager_core::cage::{Cage, CageError};
use cager_geometry::mesh::Model;

/// Vertices of the cage, and points for each. Poses do not determine finer cages well enough.
const CAGE_VERTICES: [usize; 2] = [32, 120];
const POINTS_EACH: usize = 16;

/// Why no cage can be made around a pose.
#[derive(Debug, thiserror::Error)]
pub enum PoseCageError {
    /// The model cannot be enclosed.
    #[error(transparent)]
    Enclose(#[from] EncloseError),
    /// What encloses it is no cage.
    #[error(transparent)]
    Cage(#[from] CageError),
}

/// A cage around a model.
///
/// # Errors
/// A model that cannot be enclosed.
pub fn around(model: &Model) -> Result<Cage, PoseCageError> {
    let options = EncloseOptions { vertices: vertices(model.points.len()), ..EncloseOptions::default() };
    Ok(Cage::new(enclose(model, &options)?)?)
}

/// The most vertices that a cage around a model of so many points has.
pub fn vertices(points: usize) -> usize {
    let [least, most] = CAGE_VERTICES;
    (points / POINTS_EACH).clamp(least, most).min(points / 2).max(4)
}
