//! Dense products, factorisations and solves, on top of faer.
//!
//! Large products and solves are distributed over the current rayon pool in blocks of columns that depend on the shape alone, so that results are
//! bit-identical for any number of threads; everything else is sequential unless noted.

use crate::simd::zeros;
use crate::svd::{Svd, svd};
use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::matmul::matmul;
use faer::linalg::{cholesky, lu};
use faer::{Accum, Mat, MatMut, MatRef, Par};
use rayon::prelude::*;

/// Columns that one task computes of a large product or solve.
const BLOCK_COLUMNS: usize = 192;
/// Products and solves with fewer multiplications run as a single task.
const PARALLEL_THRESHOLD: usize = 1 << 26;

/// LU factors of a tall matrix, n × m.
pub(crate) struct Pivoted<T> {
    /// L below the diagonal, whose entries are one, and U above, n × m.
    pub(crate) factors: Mat<T>,
    /// The rows of the matrix in the order of those of L.
    pub(crate) order: Vec<u32>,
    /// Smallest pivot relative to the largest, both absolute; NaN where a column vanished.
    pub(crate) smallest: f64,
}

impl<T> Pivoted<T> {
    /// The rows chosen as pivots, one per column.
    pub(crate) fn rows(&self) -> &[u32] {
        &self.order[..self.factors.ncols()]
    }
}

/// LU with partial pivoting of an n × m matrix, n ≥ m, done in place. Runs on the rayon pool, with bit-identical results for any number of threads.
pub(crate) fn pivoted<T: faer::traits::RealField + Copy + Into<f64>>(mut a: Mat<T>) -> Pivoted<T> {
    let (n, m) = a.shape();
    let mut forward = vec![0usize; n];
    let mut backward = vec![0usize; n];
    let par = Par::rayon(0);
    let mut memory =
        MemBuffer::new(lu::partial_pivoting::factor::lu_in_place_scratch::<usize, T>(n, m, par, Default::default()));
    lu::partial_pivoting::factor::lu_in_place(
        a.as_mut(),
        &mut forward,
        &mut backward,
        par,
        MemStack::new(&mut memory),
        Default::default(),
    );
    let pivots: Vec<f64> = (0..m).map(|j| Into::<f64>::into(a[(j, j)]).abs()).collect();
    let smallest = pivots.iter().fold(f64::INFINITY, |low, &p| if p < low { p } else { low });
    let largest = pivots.iter().copied().fold(0.0, f64::max);
    let smallest = if pivots.iter().any(|p| p.is_nan()) { f64::NAN } else { smallest / largest };
    Pivoted { factors: a, order: forward.into_iter().map(|r| r as u32).collect(), smallest }
}

/// Inverse of a square matrix, and the natural logarithm of its absolute determinant.
pub(crate) fn inverse(a: MatRef<'_, f64>) -> (Mat<f64>, f64) {
    let m = a.nrows();
    let mut factors = a.to_owned();
    let mut forward = vec![0usize; m];
    let mut backward = vec![0usize; m];
    let mut memory = MemBuffer::new(lu::partial_pivoting::factor::lu_in_place_scratch::<usize, f64>(
        m,
        m,
        Par::Seq,
        Default::default(),
    ));
    let (_, permutation) = lu::partial_pivoting::factor::lu_in_place(
        factors.as_mut(),
        &mut forward,
        &mut backward,
        Par::Seq,
        MemStack::new(&mut memory),
        Default::default(),
    );
    let log_volume = (0..m).map(|j| factors[(j, j)].abs().ln()).sum();
    let mut result = Mat::zeros(m, m);
    if m * m * m < PARALLEL_THRESHOLD {
        let mut memory = MemBuffer::new(lu::partial_pivoting::inverse::inverse_scratch::<usize, f64>(m, Par::Seq));
        let factors = factors.as_ref();
        let stack = MemStack::new(&mut memory);
        lu::partial_pivoting::inverse::inverse(result.as_mut(), factors, factors, permutation, Par::Seq, stack);
        return (result, log_volume);
    }
    // A = Pᵀ L U: column `forward[k]` of P's inverse is unit vector k.
    for (k, &row) in forward.iter().enumerate() {
        result[(k, row)] = 1.0;
    }
    in_column_blocks(result.as_mut(), m * m, |mut columns| {
        faer::linalg::triangular_solve::solve_unit_lower_triangular_in_place(
            factors.as_ref(),
            columns.as_mut(),
            Par::Seq,
        );
        faer::linalg::triangular_solve::solve_upper_triangular_in_place(factors.as_ref(), columns, Par::Seq);
    });
    (result, log_volume)
}

/// Calls `work` for blocks of columns that depend on the shape alone; a single block where the multiplications, `each` per column, are few.
fn in_column_blocks(a: MatMut<'_, f64>, each: usize, work: impl Fn(MatMut<'_, f64>) + Send + Sync) {
    if a.ncols().saturating_mul(each) < PARALLEL_THRESHOLD || a.ncols() <= BLOCK_COLUMNS {
        return work(a);
    }
    a.par_col_chunks_mut(BLOCK_COLUMNS).for_each(work);
}

/// Singular values and right singular vectors of a tall matrix, through its QR factorisation.
pub(crate) fn right_singular(a: Mat<f64>) -> Option<Svd> {
    svd(upper_factor(a).as_ref())
}

/// R of the QR factorisation of a tall matrix.
pub(crate) fn upper_factor(mut a: Mat<f64>) -> Mat<f64> {
    use faer::linalg::qr::no_pivoting::factor;
    let (n, m) = a.shape();
    let block = factor::recommended_block_size::<f64>(n, m);
    let mut reflectors = Mat::zeros(block, m);
    let mut memory = MemBuffer::new(factor::qr_in_place_scratch::<f64>(n, m, block, Par::Seq, Default::default()));
    factor::qr_in_place(a.as_mut(), reflectors.as_mut(), Par::Seq, MemStack::new(&mut memory), Default::default());
    Mat::from_fn(m, m, |i, j| if i <= j { a[(i, j)] } else { 0.0 })
}

/// Lower Cholesky factor in place of a symmetric positive definite matrix, zeros above; `None` where it is not definite.
pub(crate) fn cholesky(mut a: Mat<f64>) -> Option<Mat<f64>> {
    let n = a.nrows();
    let mut memory =
        MemBuffer::new(cholesky::llt::factor::cholesky_in_place_scratch::<f64>(n, Par::Seq, Default::default()));
    cholesky::llt::factor::cholesky_in_place(
        a.as_mut(),
        Default::default(),
        Par::Seq,
        MemStack::new(&mut memory),
        Default::default(),
    )
    .ok()?;
    for j in 1..n {
        for i in 0..j {
            a[(i, j)] = 0.0;
        }
    }
    Some(a)
}

/// Solves `A X = B` for symmetric positive definite A. `None` where A is not definite.
pub(crate) fn solve_definite(a: Mat<f64>, b: Mat<f64>) -> Option<Mat<f64>> {
    solve_definite_within(a, b, 0.0, 0.0)
}

/// As [`solve_definite`]; `None` also where a pivot is no more than rounding: the fraction `relative` of its diagonal entry, or a
/// diagonal entry no larger than `absolute`.
pub(crate) fn solve_definite_within(a: Mat<f64>, mut b: Mat<f64>, relative: f64, absolute: f64) -> Option<Mat<f64>> {
    let diagonal: Vec<f64> = (0..a.nrows()).map(|i| a[(i, i)]).collect();
    let l = cholesky(a)?;
    if diagonal.iter().enumerate().any(|(i, &d)| l[(i, i)] * l[(i, i)] <= relative * d || d <= absolute) {
        return None;
    }
    in_column_blocks(b.as_mut(), 2 * l.nrows() * l.nrows(), |mut columns| {
        faer::linalg::triangular_solve::solve_lower_triangular_in_place(l.as_ref(), columns.as_mut(), Par::Seq);
        faer::linalg::triangular_solve::solve_upper_triangular_in_place(l.transpose(), columns, Par::Seq);
    });
    Some(b)
}

/// `R⁻¹ X` in place, for an upper triangular R.
pub(crate) fn solve_upper(r: MatRef<'_, f64>, x: &mut Mat<f64>) {
    in_column_blocks(x.as_mut(), r.nrows() * r.nrows(), |columns| {
        faer::linalg::triangular_solve::solve_upper_triangular_in_place(r, columns, Par::Seq);
    });
}

/// `L⁻¹ X` in place, for a lower triangular L.
pub(crate) fn solve_lower(l: MatRef<'_, f64>, x: &mut Mat<f64>) {
    in_column_blocks(x.as_mut(), l.nrows() * l.nrows(), |columns| {
        faer::linalg::triangular_solve::solve_lower_triangular_in_place(l, columns, Par::Seq);
    });
}

/// The inverse of an upper triangular R.
pub(crate) fn upper_inverse(r: MatRef<'_, f64>) -> Mat<f64> {
    let mut inverse = Mat::<f64>::identity(r.nrows(), r.nrows());
    inverse.as_mut().par_col_chunks_mut(BLOCK_COLUMNS).enumerate().for_each(|(block, columns)| {
        // Below them everything stays zero.
        let rows = block * BLOCK_COLUMNS + columns.ncols();
        let columns = columns.subrows_mut(0, rows);
        faer::linalg::triangular_solve::solve_upper_triangular_in_place(
            r.submatrix(0, 0, rows, rows),
            columns,
            Par::Seq,
        );
    });
    inverse
}

/// The lower triangle of the square matrix `A · B`; zeros above it, but for squares on the diagonal.
pub(crate) fn lower_product(a: MatRef<'_, f64>, b: MatRef<'_, f64>) -> Mat<f64> {
    let n = a.nrows();
    let mut out = zeros(n, n);
    out.as_mut().par_col_chunks_mut(BLOCK_COLUMNS).enumerate().for_each(|(block, columns)| {
        let (first, count) = (block * BLOCK_COLUMNS, columns.ncols());
        multiply(columns.subrows_mut(first, n - first), a.subrows(first, n - first), b.subcols(first, count));
    });
    out
}

/// `A · B`.
pub(crate) fn product(a: MatRef<'_, f64>, b: MatRef<'_, f64>) -> Mat<f64> {
    let mut out = zeros(a.nrows(), b.ncols());
    if a.nrows() * a.ncols() * b.ncols() < PARALLEL_THRESHOLD || b.ncols() <= BLOCK_COLUMNS {
        multiply(out.as_mut(), a, b);
        return out;
    }
    out.as_mut().par_col_chunks_mut(BLOCK_COLUMNS).enumerate().for_each(|(block, columns)| {
        let count = columns.ncols();
        multiply(columns, a, b.subcols(block * BLOCK_COLUMNS, count));
    });
    out
}

/// `out = A · B`, sequentially.
pub(crate) fn multiply<T: faer::traits::ComplexField>(out: MatMut<'_, T>, a: MatRef<'_, T>, b: MatRef<'_, T>) {
    matmul(out, Accum::Replace, a, b, faer::traits::math_utils::one(), Par::Seq);
}

/// The given rows of a matrix, in the given order.
pub(crate) fn rows_of<T: Copy + Default + Send>(a: MatRef<'_, T>, rows: &[u32]) -> Mat<T> {
    let mut out = zeros(rows.len(), a.ncols());
    for j in 0..a.ncols() {
        let to = out.col_as_slice_mut(j);
        match a.col(j).try_as_col_major() {
            Some(from) => to.iter_mut().zip(rows).for_each(|(x, &i)| *x = from.as_slice()[i as usize]),
            None => to.iter_mut().zip(rows).for_each(|(x, &i)| *x = a[(i as usize, j)]),
        }
    }
    out
}

/// Rows of products whose results must not depend on the width are padded to a multiple of this: at the edges of small matrices the kernels sum in
/// another order.
pub(crate) const TILE_ROWS: usize = 16;

#[cfg(test)]
mod tests {
    use super::*;

    fn noise(rows: usize, columns: usize) -> Mat<f64> {
        let mut state = 0x9e37_79b9_7f4a_7c15u64;
        Mat::from_fn(rows, columns, |_, _| {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 33) as f64 / (1u64 << 30) as f64 - 1.0
        })
    }

    #[test]
    fn products_have_the_same_bits_at_every_width_of_a_batch() {
        use crate::inversion::{BATCH, product_columns};
        for unknowns in [4, 7, 37, 130, 332, 700, 1500] {
            for rows in [1, 2, 3, 5, 9, 21, 64].map(|tiles| tiles * TILE_ROWS) {
                let (a, b) = (noise(rows, unknowns), noise(unknowns, 3 * BATCH));
                let single = |m: &Mat<f64>| Mat::from_fn(m.nrows(), m.ncols(), |i, j| m[(i, j)] as f32);
                let (a32, b32, at) = (single(&a), single(&b), a.transpose().to_owned());
                let whole = product(at.transpose(), b.as_ref());
                let mut whole32 = Mat::zeros(rows, 3 * BATCH);
                multiply(whole32.as_mut(), a32.as_ref(), b32.as_ref());
                for frames in 1..BATCH {
                    let width = product_columns(frames);
                    let part = product(at.transpose(), b.as_ref().subcols(0, width));
                    let mut part32 = Mat::zeros(rows, width);
                    multiply(part32.as_mut(), a32.as_ref(), b32.as_ref().subcols(0, width));
                    for (i, j) in (0..rows).flat_map(|i| (0..width).map(move |j| (i, j))) {
                        assert_eq!(part[(i, j)].to_bits(), whole[(i, j)].to_bits(), "{rows} × {unknowns} × {width}");
                        assert_eq!(
                            part32[(i, j)].to_bits(),
                            whole32[(i, j)].to_bits(),
                            "{rows} × {unknowns} × {width}"
                        );
                    }
                }
            }
        }
    }
}
