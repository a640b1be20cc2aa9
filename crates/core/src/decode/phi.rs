//! A decoder's `Φ`: stored, or recomputed chunk by chunk at every use.

use super::poles::Bound;
use crate::cage::Cage;
use crate::coordinates::{PointwiseCoordinates, for_each_chunk};
use cager_geometry::linalg;
use cager_geometry::mesh::Point;
use faer::{Mat, MatRef};
use std::sync::Arc;

/// `Φ` in single precision, n × columns, column-major, padded with zero rows to a whole tile.
#[derive(Clone, Debug)]
pub(super) enum Phi {
    Stored(Arc<Mat<f32>>),
    Recomputed(Arc<Recomputed>),
}

/// What `Φ` is computed from.
#[derive(Debug)]
pub(super) struct Recomputed {
    pointwise: PointwiseCoordinates,
    cage: Cage,
    points: Vec<Point>,
    columns: usize,
    /// Points with other coordinates.
    bound: Bound,
}

impl Phi {
    pub(super) fn computed(pointwise: PointwiseCoordinates, cage: Cage, points: Vec<Point>, columns: usize) -> Self {
        Self::Recomputed(Arc::new(Recomputed { pointwise, cage, points, columns, bound: Bound::none() }))
    }

    /// Gives some points other coordinates.
    ///
    /// # Panics
    /// Where it is shared already and recomputed.
    pub(super) fn bind(&mut self, bound: Bound) {
        match self {
            Self::Stored(phi) => {
                let phi = Arc::make_mut(phi);
                let all = bound.within(0, phi.nrows());
                put(phi, &bound, all);
            }
            Self::Recomputed(computed) => {
                Arc::get_mut(computed).expect("coordinates that are not shared yet").bound = bound;
            }
        }
    }

    pub(super) fn columns(&self) -> usize {
        match self {
            Self::Stored(phi) => phi.ncols(),
            Self::Recomputed(computed) => computed.columns,
        }
    }

    pub(super) fn kept(&self) -> Option<MatRef<'_, f32>> {
        match self {
            Self::Stored(phi) => Some((**phi).as_ref()),
            Self::Recomputed(_) => None,
        }
    }

    /// Calls `work` with the first row of each chunk and its rows, whole blocks but for the last.
    pub(super) fn for_each_part(&self, mut work: impl FnMut(usize, MatRef<'_, f32>)) {
        match self {
            Self::Stored(phi) => work(0, (**phi).as_ref()),
            Self::Recomputed(computed) => {
                let Recomputed { pointwise, cage, points, columns, bound } = &**computed;
                for_each_chunk(*pointwise, cage, points, *columns, |first, part| {
                    let mut phi = to_padded_single(part.phi.as_ref());
                    put(&mut phi, bound, bound.within(first, part.phi.nrows()));
                    work(first, phi.as_ref());
                });
            }
        }
    }

    pub(super) fn rows(&self, rows: &[u32]) -> Mat<f32> {
        match self {
            Self::Stored(phi) => linalg::rows_of((**phi).as_ref(), rows),
            Self::Recomputed(computed) => {
                let points: Vec<Point> = rows.iter().map(|&i| computed.points[i as usize]).collect();
                let cage = computed.cage.of_points(rows.iter().copied());
                let mut phi = to_padded_single((computed.pointwise)(&cage, &points).phi.as_ref());
                let at = rows.iter().enumerate();
                let bound = &computed.bound;
                put(&mut phi, bound, at.filter_map(|(row, i)| Some((row, bound.places.binary_search(i).ok()?))));
                phi.subrows(0, rows.len()).to_owned()
            }
        }
    }
}

/// Replaces rows of bound points: pairs of a row and its place among those bound.
fn put(phi: &mut Mat<f32>, bound: &Bound, rows: impl Iterator<Item = (usize, usize)>) {
    for (row, at) in rows {
        (0..phi.ncols()).for_each(|j| phi[(row, j)] = bound.rows[(at, j)] as f32);
    }
}

pub(super) fn padded(points: usize, columns: usize) -> Mat<f32> {
    linalg::zeros(points.next_multiple_of(linalg::TILE_ROWS), columns)
}

/// Converts to single precision, padded with zero rows to a whole tile.
pub(super) fn to_padded_single(phi: MatRef<'_, f64>) -> Mat<f32> {
    linalg::to_single(phi, phi.nrows().next_multiple_of(linalg::TILE_ROWS))
}
