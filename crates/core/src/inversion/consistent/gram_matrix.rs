//! Gram matrix of the points read, from the decoder's single-precision coordinates.

use crate::decode::Decoder;
use cager_geometry::linalg::{BLOCK_ROWS, to_double};
use faer::{Accum, Mat, Par};
use rayon::prelude::*;

/// Columns of the Gram matrix that one task computes.
const TASK_COLUMNS: usize = 64;

/// Puts `count` rows of Φ from `first` on into a matrix in double precision.
pub(super) fn convert(decoder: &Decoder, first: usize, count: usize, out: &mut Mat<f64>) {
    let computed;
    let phi = match decoder.coordinates() {
        Some(phi) => phi.subrows(first, count),
        None => {
            computed = decoder.rows(&(first as u32..(first + count) as u32).collect::<Vec<_>>());
            computed.as_ref()
        }
    };
    for j in 0..phi.ncols() {
        for (to, &x) in out.col_as_slice_mut(j).iter_mut().zip(phi.col(j).iter()) {
            *to = f64::from(x);
        }
    }
}

/// `share · ΦᵀΦ` of the given rows, or of all points. The same bits for any number of threads.
pub(super) fn gram(decoder: &Decoder, rows: Option<&[u32]>, share: f64) -> Mat<f64> {
    let total = decoder.columns();
    let mut gram = Mat::<f64>::zeros(total, total);
    let rows_read = rows.map(|rows| to_double(decoder.rows(rows).as_ref()));
    gram.as_mut().par_col_chunks_mut(TASK_COLUMNS).enumerate().for_each(|(task, mut columns)| {
        let (left, width) = (task * TASK_COLUMNS, columns.ncols());
        if let Some(rows) = &rows_read {
            let some = rows.as_ref().subcols(left, width);
            faer::linalg::matmul::matmul(columns, Accum::Replace, rows.transpose(), some, share, Par::Seq);
            return;
        }
        let points = decoder.points();
        let mut all = Mat::<f64>::zeros(BLOCK_ROWS.min(points), total);
        for first in (0..points).step_by(BLOCK_ROWS) {
            let count = BLOCK_ROWS.min(points - first);
            convert(decoder, first, count, &mut all);
            let block = all.as_ref().subrows(0, count);
            let accumulate = if first == 0 { Accum::Replace } else { Accum::Add };
            let some = block.subcols(left, width);
            faer::linalg::matmul::matmul(columns.as_mut(), accumulate, block.transpose(), some, share, Par::Seq);
        }
    });
    // Exactly symmetric, as the conjugate gradients assume.
    for j in 0..total {
        for i in 0..j {
            gram[(j, i)] = gram[(i, j)];
        }
    }
    gram
}
