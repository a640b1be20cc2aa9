//! The model whose motion is moved.

use cager_core::cage::Cage;
use cager_geometry::mesh::{Point, TriMesh};
use faer::MatRef;
use glam::DVec3;

use crate::error::TransferError;
use crate::similarity::Similarity;

/// A model at rest, its cage and its coordinates.
#[derive(Clone, Copy)]
pub struct Source<'a> {
    /// The model at rest, with triangles.
    pub rest: &'a TriMesh,
    /// A closed cage around it.
    pub cage: &'a Cage,
    /// Coordinates, n × m, one column per vertex of the cage.
    pub phi: MatRef<'a, f64>,
}

/// A frame, checked and moved.
///
/// # Errors
/// Another number of points than `expected`, or one that is not finite.
pub(crate) fn moved_frame(
    frame: usize,
    points: &[Point],
    expected: usize,
    by: &Similarity,
) -> Result<Vec<DVec3>, TransferError> {
    if points.len() != expected {
        return Err(TransferError::FramePoints { frame, points: points.len(), expected });
    }
    if let Some(point) = points.iter().position(|p| p.iter().any(|x| !x.is_finite())) {
        return Err(TransferError::FrameNotFinite { frame, point });
    }
    Ok(points.iter().map(|&p| by.apply(p.into())).collect())
}
