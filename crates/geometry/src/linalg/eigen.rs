//! Eigenvalues of symmetric matrices, by faer, sequentially.

use faer::diag::Diag;
use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::evd::{ComputeEigenvectors, self_adjoint_evd, self_adjoint_evd_scratch};
use faer::{Mat, MatRef, Par};

/// Eigenvalues of a symmetric matrix, descending, and their vectors as columns.
pub fn eigen(a: MatRef<'_, f64>) -> Option<(Vec<f64>, Mat<f64>)> {
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
