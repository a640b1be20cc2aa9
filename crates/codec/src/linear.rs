//! Products and decompositions by faer, sequential or in blocks of a size of their own, so that results do not depend on the number of threads.

use faer::diag::Diag;
use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::evd::{ComputeEigenvectors, self_adjoint_evd, self_adjoint_evd_scratch};
use faer::linalg::matmul::matmul;
use faer::linalg::matmul::triangular::{self, BlockStructure};
use faer::{Accum, Mat, MatRef, Par};
use rayon::prelude::*;

/// Fewest rows that one task multiplies, and most tasks.
const BLOCK_ROWS: usize = 2048;
const MOST_BLOCKS: usize = 16;

/// `A · B`.
pub(crate) fn product(a: MatRef<'_, f64>, b: MatRef<'_, f64>) -> Mat<f64> {
    let mut out = Mat::zeros(a.nrows(), b.ncols());
    matmul(out.as_mut(), Accum::Replace, a, b, 1.0, Par::Seq);
    out
}

fn block_rows(rows: usize) -> usize {
    rows.div_ceil(MOST_BLOCKS).max(BLOCK_ROWS)
}

/// `Aᵀ A` of a matrix with many rows.
pub(crate) fn gram(a: MatRef<'_, f64>) -> Mat<f64> {
    let of_block = |rows: MatRef<'_, f64>| {
        let mut part = Mat::zeros(a.ncols(), a.ncols());
        let (full, lower) = (BlockStructure::Rectangular, BlockStructure::TriangularLower);
        triangular::matmul(part.as_mut(), lower, Accum::Replace, rows.transpose(), full, rows, full, 1.0, Par::Seq);
        part
    };
    let parts: Vec<Mat<f64>> = a.par_row_chunks(block_rows(a.nrows())).map(of_block).collect();
    let sum = |i: usize, j: usize| parts.iter().map(|part| part[(i.max(j), i.min(j))]).sum();
    Mat::from_fn(a.ncols(), a.ncols(), sum)
}

/// `A · B` of a matrix A with many rows.
pub(crate) fn tall_product(a: MatRef<'_, f64>, b: MatRef<'_, f64>) -> Mat<f64> {
    let mut out = Mat::zeros(a.nrows(), b.ncols());
    let block = block_rows(a.nrows());
    let parts = out.par_row_chunks_mut(block).zip(a.par_row_chunks(block));
    parts.for_each(|(out, a)| matmul(out, Accum::Replace, a, b, 1.0, Par::Seq));
    out
}

/// Eigenvalues of a symmetric matrix, descending, and their vectors as columns; `None` where it is not finite.
pub(crate) fn eigen(a: MatRef<'_, f64>) -> Option<(Vec<f64>, Mat<f64>)> {
    let n = a.nrows();
    if !a.is_all_finite() {
        return None;
    }
    let largest = a.norm_max();
    let scale = if largest > 0.0 { largest.log2().floor().exp2() } else { 1.0 };
    let scaled = Mat::from_fn(n, n, |i, j| a[(i, j)] / scale);
    let (mut values, mut vectors) = (Diag::zeros(n), Mat::zeros(n, n));
    let scratch = self_adjoint_evd_scratch::<f64>(n, ComputeEigenvectors::Yes, Par::Seq, Default::default());
    let mut memory = MemBuffer::new(scratch);
    let stack = MemStack::new(&mut memory);
    self_adjoint_evd(scaled.as_ref(), values.as_mut(), Some(vectors.as_mut()), Par::Seq, stack, Default::default())
        .ok()?;
    let values = values.column_vector().iter().rev().map(|v| v * scale).collect();
    Some((values, vectors.reverse_cols().to_owned()))
}

/// Lower Cholesky factor of a symmetric positive definite matrix, zeros above.
pub(crate) fn cholesky(a: MatRef<'_, f64>) -> Option<Mat<f64>> {
    use faer::linalg::cholesky::llt::factor;
    let n = a.nrows();
    let mut l = a.to_owned();
    let mut memory = MemBuffer::new(factor::cholesky_in_place_scratch::<f64>(n, Par::Seq, Default::default()));
    let stack = MemStack::new(&mut memory);
    factor::cholesky_in_place(l.as_mut(), Default::default(), Par::Seq, stack, Default::default()).ok()?;
    for j in 1..n {
        for i in 0..j {
            l[(i, j)] = 0.0;
        }
    }
    Some(l)
}

/// Solves `L Lᵀ X = B` in place, given L.
pub(crate) fn solve_cholesky(l: MatRef<'_, f64>, x: &mut Mat<f64>) {
    faer::linalg::triangular_solve::solve_lower_triangular_in_place(l, x.as_mut(), Par::Seq);
    faer::linalg::triangular_solve::solve_upper_triangular_in_place(l.transpose(), x.as_mut(), Par::Seq);
}
