//! Where a decoder's `Φ` comes from: kept, or computed anew wherever it is used.

use super::BLOCK_ROWS;
use crate::cage::Cage;
use crate::coordinates::{ByPoint, Coordinates};
use crate::dense;
use crate::mesh::Point;
use crate::simd;
use faer::{Mat, MatRef};
use rayon::prelude::*;
use std::sync::Arc;

/// Coordinates computed at a time take about so much memory, in both precisions together.
const PART_BYTES: usize = 96 << 20;

/// `Φ` in single precision, n × columns, column-major; zero rows follow up to a whole tile.
#[derive(Clone, Debug)]
pub(super) enum Phi {
    Kept(Arc<Mat<f32>>),
    Computed(Arc<Computed>),
}

/// What `Φ` is computed from.
#[derive(Debug)]
pub(super) struct Computed {
    by_point: ByPoint,
    cage: Cage,
    points: Vec<Point>,
    columns: usize,
}

impl Phi {
    pub(super) fn computed(by_point: ByPoint, cage: Cage, points: Vec<Point>, columns: usize) -> Self {
        Self::Computed(Arc::new(Computed { by_point, cage, points, columns }))
    }

    pub(super) fn columns(&self) -> usize {
        match self {
            Self::Kept(phi) => phi.ncols(),
            Self::Computed(computed) => computed.columns,
        }
    }

    pub(super) fn kept(&self) -> Option<MatRef<'_, f32>> {
        match self {
            Self::Kept(phi) => Some((**phi).as_ref()),
            Self::Computed(_) => None,
        }
    }

    /// Calls `work` with the first row of each part and its rows, whole blocks but for the last, in order.
    pub(super) fn for_parts(&self, mut work: impl FnMut(usize, MatRef<'_, f32>)) {
        match self {
            Self::Kept(phi) => work(0, (**phi).as_ref()),
            Self::Computed(computed) => {
                let Computed { by_point, cage, points, columns } = &**computed;
                in_parts(*by_point, cage, points, *columns, |first, part| {
                    work(first, single(part.phi.as_ref()).as_ref());
                });
            }
        }
    }

    pub(super) fn rows(&self, rows: &[u32]) -> Mat<f32> {
        match self {
            Self::Kept(phi) => dense::rows_of((**phi).as_ref(), rows),
            Self::Computed(computed) => {
                let points: Vec<Point> = rows.iter().map(|&i| computed.points[i as usize]).collect();
                single((computed.by_point)(&computed.cage, &points).phi.as_ref()).subrows(0, rows.len()).to_owned()
            }
        }
    }
}

/// Computes coordinates of some points at a time, whole blocks but for the last; `work` is told the first point of each part, and its
/// coordinates.
pub(crate) fn in_parts(
    by_point: ByPoint,
    cage: &Cage,
    points: &[Point],
    columns: usize,
    mut work: impl FnMut(usize, &Coordinates),
) {
    let size = (PART_BYTES / (12 * columns)).max(1).next_multiple_of(BLOCK_ROWS);
    for (part, points) in points.chunks(size).enumerate() {
        work(part * size, &by_point(cage, points));
    }
}

pub(super) fn padded(points: usize, columns: usize) -> Mat<f32> {
    simd::zeros(points.next_multiple_of(dense::WHOLE_ROWS), columns)
}

/// In single precision, with zero rows up to a whole tile.
pub(super) fn single(phi: MatRef<'_, f64>) -> Mat<f32> {
    let mut single = padded(phi.nrows(), phi.ncols());
    single.as_mut().par_col_chunks_mut(1).enumerate().for_each(|(j, mut column)| {
        for (s, &x) in column.as_mut().col_mut(0).iter_mut().zip(phi.col(j).iter()) {
            *s = x as f32;
        }
    });
    single
}
