//! Factorisations and solves, large ones shared by the rayon pool in blocks of columns.

use super::products::{BLOCK_COLUMNS, PARALLEL_THRESHOLD};
use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::triangular_solve::{
    solve_lower_triangular_in_place, solve_unit_lower_triangular_in_place, solve_upper_triangular_in_place,
};
use faer::linalg::{cholesky, lu};
use faer::perm::PermRef;
use faer::{Mat, MatMut, MatRef, Par};
use rayon::prelude::*;

/// LU factors of a tall matrix, n × m.
pub struct Pivoted<T> {
    /// L below the diagonal, whose entries are one, and U above, n × m.
    pub factors: Mat<T>,
    /// The rows of the matrix in the order of those of L.
    pub order: Vec<u32>,
    /// Smallest pivot relative to the largest, both absolute; NaN where a column vanished.
    pub smallest: f64,
}

impl<T> Pivoted<T> {
    /// The rows chosen as pivots, one per column.
    pub fn rows(&self) -> &[u32] {
        &self.order[..self.factors.ncols()]
    }
}

/// LU with partial pivoting of an n × m matrix, n ≥ m, to the same bits on any threads.
pub fn pivoted<T: faer::traits::RealField + Copy + Into<f64>>(mut a: Mat<T>) -> Pivoted<T> {
    let m = a.ncols();
    let [forward, _] = lu_in_place(a.as_mut(), Par::rayon(0));
    let pivots: Vec<f64> = (0..m).map(|j| Into::<f64>::into(a[(j, j)]).abs()).collect();
    let smallest = pivots.iter().fold(f64::INFINITY, |low, &p| if p < low { p } else { low });
    let largest = pivots.iter().copied().fold(0.0, f64::max);
    let smallest = if pivots.iter().any(|p| p.is_nan()) { f64::NAN } else { smallest / largest };
    Pivoted { factors: a, order: forward.into_iter().map(|r| r as u32).collect(), smallest }
}

/// LU with partial pivoting, in place: the matrix's rows in the order of those of L, and back.
fn lu_in_place<T: faer::traits::RealField>(a: MatMut<'_, T>, par: Par) -> [Vec<usize>; 2] {
    use lu::partial_pivoting::factor;
    let (n, m) = a.shape();
    let [mut forward, mut backward] = [vec![0; n], vec![0; n]];
    let mut memory = MemBuffer::new(factor::lu_in_place_scratch::<usize, T>(n, m, par, Default::default()));
    let stack = MemStack::new(&mut memory);
    factor::lu_in_place(a, &mut forward, &mut backward, par, stack, Default::default());
    [forward, backward]
}

/// Inverse of a square matrix, and the natural logarithm of its absolute determinant.
pub fn inverse(a: MatRef<'_, f64>) -> (Mat<f64>, f64) {
    let m = a.nrows();
    let mut factors = a.to_owned();
    let [forward, backward] = lu_in_place(factors.as_mut(), Par::Seq);
    let log_volume = (0..m).map(|j| factors[(j, j)].abs().ln()).sum();
    let mut result = Mat::zeros(m, m);
    if m * m * m < PARALLEL_THRESHOLD {
        let mut memory = MemBuffer::new(lu::partial_pivoting::inverse::inverse_scratch::<usize, f64>(m, Par::Seq));
        let factors = factors.as_ref();
        let stack = MemStack::new(&mut memory);
        let permutation = PermRef::new_checked(&forward, &backward, m);
        lu::partial_pivoting::inverse::inverse(result.as_mut(), factors, factors, permutation, Par::Seq, stack);
        return (result, log_volume);
    }
    // A = Pᵀ L U: column `forward[k]` of P's inverse is unit vector k.
    for (k, &row) in forward.iter().enumerate() {
        result[(k, row)] = 1.0;
    }
    in_column_blocks(result.as_mut(), m * m, |mut columns| {
        solve_unit_lower_triangular_in_place(factors.as_ref(), columns.as_mut(), Par::Seq);
        solve_upper_triangular_in_place(factors.as_ref(), columns, Par::Seq);
    });
    (result, log_volume)
}

/// Calls `work` for blocks of columns that depend on the shape alone.
fn in_column_blocks(a: MatMut<'_, f64>, each: usize, work: impl Fn(MatMut<'_, f64>) + Send + Sync) {
    if a.ncols().saturating_mul(each) < PARALLEL_THRESHOLD || a.ncols() <= BLOCK_COLUMNS {
        return work(a);
    }
    a.par_col_chunks_mut(BLOCK_COLUMNS).for_each(work);
}

/// R of the QR factorisation of a tall matrix.
pub fn upper_factor(mut a: Mat<f64>) -> Mat<f64> {
    use faer::linalg::qr::no_pivoting::factor;
    let (n, m) = a.shape();
    let block = factor::recommended_block_size::<f64>(n, m);
    let mut reflectors = Mat::zeros(block, m);
    let mut memory = MemBuffer::new(factor::qr_in_place_scratch::<f64>(n, m, block, Par::Seq, Default::default()));
    factor::qr_in_place(a.as_mut(), reflectors.as_mut(), Par::Seq, MemStack::new(&mut memory), Default::default());
    Mat::from_fn(m, m, |i, j| if i <= j { a[(i, j)] } else { 0.0 })
}

/// Lower Cholesky factor, zeros above; `None` where the matrix is not definite.
pub fn cholesky(mut a: Mat<f64>) -> Option<Mat<f64>> {
    cholesky_in_place(a.as_mut(), Par::Seq)?;
    for j in 1..a.nrows() {
        for i in 0..j {
            a[(i, j)] = 0.0;
        }
    }
    Some(a)
}

/// Cholesky factor in place of the lower triangle; `None` where the matrix is not definite.
pub fn cholesky_in_place(a: MatMut<'_, f64>, par: Par) -> Option<()> {
    use cholesky::llt::factor;
    let mut memory = MemBuffer::new(factor::cholesky_in_place_scratch::<f64>(a.nrows(), par, Default::default()));
    factor::cholesky_in_place(a, Default::default(), par, MemStack::new(&mut memory), Default::default()).ok()?;
    Some(())
}

/// Cholesky factor with diagonal pivoting, from the lower triangle: L, m × r for the numerical rank
/// r, with a diagonal that falls, and the row of the matrix that each row of L belongs to. `None`
/// where the matrix is indefinite beyond rounding.
pub fn pivoted_cholesky(mut a: Mat<f64>) -> Option<(Mat<f64>, Vec<usize>)> {
    use cholesky::llt_pivoting::factor;
    let m = a.nrows();
    let [mut forward, mut backward] = [vec![0; m], vec![0; m]];
    let scratch = factor::cholesky_in_place_scratch::<usize, f64>(m, Par::Seq, Default::default());
    let mut memory = MemBuffer::new(scratch);
    let stack = MemStack::new(&mut memory);
    let found = factor::cholesky_in_place(a.as_mut(), &mut forward, &mut backward, Par::Seq, stack, Default::default());
    let rank = found.ok()?.0.rank;
    Some((Mat::from_fn(m, rank, |i, j| if i >= j { a[(i, j)] } else { 0.0 }), forward))
}

/// Solves `A X = B` for symmetric positive definite A. `None` where A is not definite.
pub fn solve_definite(a: Mat<f64>, b: Mat<f64>) -> Option<Mat<f64>> {
    solve_definite_within(a, b, 0.0, 0.0)
}

/// As [`solve_definite`]; `None` also where a pivot is no more than the fraction `relative` of its
/// diagonal entry, or a diagonal entry no larger than `absolute`.
pub fn solve_definite_within(a: Mat<f64>, mut b: Mat<f64>, relative: f64, absolute: f64) -> Option<Mat<f64>> {
    let diagonal: Vec<f64> = (0..a.nrows()).map(|i| a[(i, i)]).collect();
    let l = cholesky(a)?;
    if diagonal.iter().enumerate().any(|(i, &d)| l[(i, i)] * l[(i, i)] <= relative * d || d <= absolute) {
        return None;
    }
    solve_cholesky(l.as_ref(), &mut b);
    Some(b)
}

/// Solves `L Lᵀ X = B` in place, given the lower triangular L.
pub fn solve_cholesky(l: MatRef<'_, f64>, x: &mut Mat<f64>) {
    in_column_blocks(x.as_mut(), 2 * l.nrows() * l.nrows(), |mut columns| {
        solve_lower_triangular_in_place(l, columns.as_mut(), Par::Seq);
        solve_upper_triangular_in_place(l.transpose(), columns, Par::Seq);
    });
}

/// `L⁻¹ X` in place, for a lower triangular L.
pub fn solve_lower(l: MatRef<'_, f64>, x: &mut Mat<f64>) {
    in_column_blocks(x.as_mut(), l.nrows() * l.nrows(), |columns| {
        solve_lower_triangular_in_place(l, columns, Par::Seq);
    });
}

/// The inverse of an upper triangular R.
pub fn upper_inverse(r: MatRef<'_, f64>) -> Mat<f64> {
    let mut inverse = Mat::<f64>::identity(r.nrows(), r.nrows());
    inverse.as_mut().par_col_chunks_mut(BLOCK_COLUMNS).enumerate().for_each(|(block, columns)| {
        // Below them everything stays zero.
        let rows = block * BLOCK_COLUMNS + columns.ncols();
        let columns = columns.subrows_mut(0, rows);
        solve_upper_triangular_in_place(r.submatrix(0, 0, rows, rows), columns, Par::Seq);
    });
    inverse
}
