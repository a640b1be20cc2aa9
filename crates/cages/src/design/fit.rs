//! Least-squares cages of a sampled motion, and their residuals.

use faer::linalg::matmul::{matmul, triangular};
use faer::linalg::triangular_solve::{solve_lower_triangular_in_place, solve_upper_triangular_in_place};
use faer::{Accum, Mat, MatRef, Par, Side};
use rayon::prelude::*;

/// Rows of one parallel task. Sums over tasks are added in their order, so that they do not depend on the number of threads.
const BLOCK_ROWS: usize = 512;
/// Blocks of rows that are multiplied at the same time.
const BLOCKS: usize = 4;

/// Least-squares cages of a motion, `min ‖X − Φ C‖² + ρ ‖C‖²`.
pub(super) struct Fit {
    /// Cages `C`, m × c.
    pub(super) cages: Mat<f64>,
    /// Residual `X − Φ C`, n × c.
    pub(super) residual: Mat<f64>,
    /// Lower Cholesky factor of `ΦᵀΦ + ρ`, m × m.
    pub(super) factor: Mat<f64>,
}

/// Sums `f(rows)` over blocks of rows, in their order.
fn sum_over_blocks(rows: usize, shape: (usize, usize), f: impl Fn(usize, usize) -> Mat<f64> + Sync) -> Mat<f64> {
    let mut sum = Mat::zeros(shape.0, shape.1);
    // A few at a time: each block has as many entries as the sum.
    for first in (0..rows).step_by(BLOCKS * BLOCK_ROWS) {
        let some: Vec<usize> = (first..rows).step_by(BLOCK_ROWS).take(BLOCKS).collect();
        let blocks: Vec<Mat<f64>> = some.into_par_iter().map(|first| f(first, BLOCK_ROWS.min(rows - first))).collect();
        for block in &blocks {
            sum += block;
        }
    }
    sum
}

/// `ΦᵀΦ`, its lower half.
pub(super) fn gram(phi: MatRef<'_, f64>) -> Mat<f64> {
    let m = phi.ncols();
    sum_over_blocks(phi.nrows(), (m, m), |first, count| {
        let rows = phi.subrows(first, count);
        let mut out = Mat::zeros(m, m);
        triangular::matmul(
            out.as_mut(),
            triangular::BlockStructure::TriangularLower,
            Accum::Replace,
            rows.transpose(),
            triangular::BlockStructure::Rectangular,
            rows,
            triangular::BlockStructure::Rectangular,
            1.0,
            Par::Seq,
        );
        out
    })
}

/// `Aᵀ B`.
pub(super) fn transposed_product(a: MatRef<'_, f64>, b: MatRef<'_, f64>) -> Mat<f64> {
    sum_over_blocks(a.nrows(), (a.ncols(), b.ncols()), |first, count| {
        let mut out = Mat::zeros(a.ncols(), b.ncols());
        let (a, b) = (a.subrows(first, count), b.subrows(first, count));
        matmul(out.as_mut(), Accum::Replace, a.transpose(), b, 1.0, Par::Seq);
        out
    })
}

/// `out = β out + α A B`, by blocks of rows.
pub(super) fn product(out: &mut Mat<f64>, accumulate: Accum, a: MatRef<'_, f64>, b: MatRef<'_, f64>, alpha: f64) {
    out.as_mut().par_row_chunks_mut(BLOCK_ROWS).enumerate().for_each(|(block, rows)| {
        let a = a.subrows(block * BLOCK_ROWS, rows.nrows());
        matmul(rows, accumulate, a, b, alpha, Par::Seq);
    });
}

/// Solves `L Lᵀ X = B` in place.
pub(super) fn solve(factor: MatRef<'_, f64>, b: &mut Mat<f64>) {
    solve_lower_triangular_in_place(factor, b.as_mut(), Par::Seq);
    solve_upper_triangular_in_place(factor.transpose(), b.as_mut(), Par::Seq);
}

impl Fit {
    /// Fits the motion X, n × c, with the ridge `ρ` as a fraction of the mean diagonal entry of `ΦᵀΦ`.
    pub(super) fn new(phi: MatRef<'_, f64>, motion: MatRef<'_, f64>, ridge: f64) -> Option<Self> {
        let m = phi.ncols();
        let mut gram = gram(phi);
        let mean = (0..m).map(|j| gram[(j, j)]).sum::<f64>() / m as f64;
        for j in 0..m {
            gram[(j, j)] += ridge * mean;
        }
        let factor = gram.llt(Side::Lower).ok()?.L().to_owned();
        let mut cages = transposed_product(phi, motion);
        solve(factor.as_ref(), &mut cages);
        let mut residual = motion.to_owned();
        product(&mut residual, Accum::Add, phi, cages.as_ref(), -1.0);
        let finite = residual.as_ref().squared_norm_l2().is_finite();
        finite.then_some(Self { cages, residual, factor })
    }
}
