//! Products, sequential or in blocks that depend on the shape alone: the same bits on any threads.

use super::zeros;
use faer::linalg::matmul::matmul;
use faer::linalg::matmul::triangular::{self, BlockStructure};
use faer::traits::RealField;
use faer::traits::math_utils::one;
use faer::{Accum, Mat, MatMut, MatRef, Par};
use rayon::prelude::*;

/// Columns that one task computes of a large product or solve.
pub(super) const BLOCK_COLUMNS: usize = 192;
/// Products and solves with fewer multiplications run as a single task.
pub(super) const PARALLEL_THRESHOLD: usize = 1 << 26;
/// Rows that one task computes of the product of a matrix with many rows.
pub const BLOCK_ROWS: usize = 1024;
/// Parts of a sum that are computed at the same time, at the least and at the most.
const PARTS_AT_ONCE: [usize; 2] = [4, 16];
/// Entries of all those parts, beyond which only the least number is computed at the same time.
const MAX_PART_ENTRIES: usize = 1 << 24;

/// Rows of products whose results must not depend on the width are padded to a multiple of this.
pub const TILE_ROWS: usize = 16;
/// Columns likewise.
pub const TILE_COLUMNS: usize = 4;

/// The lower triangle of the square matrix `A · B`; zeros above, but for squares on the diagonal.
pub fn lower_product(a: MatRef<'_, f64>, b: MatRef<'_, f64>) -> Mat<f64> {
    let n = a.nrows();
    let mut out = zeros(n, n);
    out.as_mut().par_col_chunks_mut(BLOCK_COLUMNS).enumerate().for_each(|(block, columns)| {
        let (first, count) = (block * BLOCK_COLUMNS, columns.ncols());
        multiply(columns.subrows_mut(first, n - first), a.subrows(first, n - first), b.subcols(first, count));
    });
    out
}

/// `A · B`.
pub fn product(a: MatRef<'_, f64>, b: MatRef<'_, f64>) -> Mat<f64> {
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

/// `out = A · B`, sequentially; see [`multiply_add`].
pub fn multiply<T: RealField + Copy>(out: MatMut<'_, T>, a: MatRef<'_, T>, b: MatRef<'_, T>) {
    multiply_add(out, Accum::Replace, a, b, one());
}

/// `out = α A B`, or what is added to it, sequentially. A column has the same bits whatever other
/// columns there are, where these are whole tiles.
pub fn multiply_add<T: RealField + Copy>(
    out: MatMut<'_, T>,
    accumulate: Accum,
    a: MatRef<'_, T>,
    b: MatRef<'_, T>,
    alpha: T,
) {
    // So few entries of a transposed matrix are summed by another kernel, in another order.
    const FEW_ENTRIES: usize = 256;
    if out.nrows() * out.ncols() <= FEW_ENTRIES && a.col_stride() == 1 {
        let by_columns = a.to_owned();
        return matmul(out, accumulate, by_columns.as_ref(), b, alpha, Par::Seq);
    }
    matmul(out, accumulate, a, b, alpha, Par::Seq);
}

/// The given rows of a matrix, in the given order.
pub fn rows_of<T: Copy + Default + Send>(a: MatRef<'_, T>, rows: &[u32]) -> Mat<T> {
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

/// A matrix in single precision, followed by rows of zeros up to so many.
pub fn to_single(a: MatRef<'_, f64>, rows: usize) -> Mat<f32> {
    let mut out = zeros(rows, a.ncols());
    out.as_mut().par_col_iter_mut().zip(a.par_col_iter()).for_each(|(out, a)| {
        out.iter_mut().zip(a.iter()).for_each(|(out, &x)| *out = x as f32);
    });
    out
}

/// `A · B` of a matrix A with many rows, in blocks of these.
pub fn tall_product(a: MatRef<'_, f64>, b: MatRef<'_, f64>) -> Mat<f64> {
    let mut out = zeros(a.nrows(), b.ncols());
    accumulate_product(&mut out, Accum::Replace, a, b, 1.0);
    out
}

/// `out = α A B`, or what is added to it, of a matrix A with many rows, in blocks of these.
pub fn accumulate_product<T: RealField + Copy>(
    out: &mut Mat<T>,
    accumulate: Accum,
    a: MatRef<'_, T>,
    b: MatRef<'_, T>,
    alpha: T,
) {
    out.as_mut().par_row_chunks_mut(BLOCK_ROWS).enumerate().for_each(|(block, rows)| {
        let a = a.subrows(block * BLOCK_ROWS, rows.nrows());
        matmul(rows, accumulate, a, b, alpha, Par::Seq);
    });
}

/// `AᵀA`, its lower triangle and zeros above, summed over blocks of so many rows; a single block is
/// computed by the calling thread.
pub fn gram<T: RealField + Copy>(a: MatRef<'_, T>, block_rows: usize) -> Mat<T> {
    let m = a.ncols();
    let (full, lower) = (BlockStructure::Rectangular, BlockStructure::TriangularLower);
    sum_over_blocks(a.nrows(), block_rows, (m, m), |first, count| {
        let (mut part, rows) = (Mat::zeros(m, m), a.subrows(first, count));
        triangular::matmul(part.as_mut(), lower, Accum::Replace, rows.transpose(), full, rows, full, one(), Par::Seq);
        part
    })
}

/// A matrix in double precision.
pub fn to_double(a: MatRef<'_, f32>) -> Mat<f64> {
    let mut out = zeros(a.nrows(), a.ncols());
    out.as_mut().par_col_iter_mut().zip(a.par_col_iter()).for_each(|(out, a)| {
        out.iter_mut().zip(a.iter()).for_each(|(out, &x)| *out = x.into());
    });
    out
}

/// A symmetric matrix from its lower triangle.
#[must_use]
pub fn mirrored(mut a: Mat<f64>) -> Mat<f64> {
    for j in 1..a.ncols() {
        for i in 0..j {
            a[(i, j)] = a[(j, i)];
        }
    }
    a
}

/// `AᵀB`, summed over blocks of so many rows.
pub fn transposed_product<T: RealField + Copy>(a: MatRef<'_, T>, b: MatRef<'_, T>, block_rows: usize) -> Mat<T> {
    let shape = (a.ncols(), b.ncols());
    sum_over_blocks(a.nrows(), block_rows, shape, |first, count| {
        let mut part = Mat::zeros(shape.0, shape.1);
        multiply(part.as_mut(), a.subrows(first, count).transpose(), b.subrows(first, count));
        part
    })
}

/// Sums `part(first row, rows)` over blocks of rows, in their order.
fn sum_over_blocks<T: RealField + Copy>(
    rows: usize,
    block_rows: usize,
    shape: (usize, usize),
    part: impl Fn(usize, usize) -> Mat<T> + Sync,
) -> Mat<T> {
    if rows <= block_rows {
        return part(0, rows);
    }
    let mut sum = Mat::zeros(shape.0, shape.1);
    let blocks: Vec<usize> = (0..rows).step_by(block_rows).collect();
    let at_once = (MAX_PART_ENTRIES / (shape.0 * shape.1).max(1)).clamp(PARTS_AT_ONCE[0], PARTS_AT_ONCE[1]);
    for some in blocks.chunks(at_once) {
        let parts: Vec<Mat<T>> = some.par_iter().map(|&first| part(first, block_rows.min(rows - first))).collect();
        parts.iter().for_each(|part| sum += part);
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Frames that are multiplied together at the most, three columns each.
    const BATCH: usize = 16;

    fn noise(rows: usize, columns: usize) -> Mat<f64> {
        let mut random = fastrand::Rng::with_seed((rows + columns) as u64);
        Mat::from_fn(rows, columns, |_, _| random.f64() - 0.5)
    }

    #[test]
    fn products_have_the_same_bits_at_every_width_of_a_batch() {
        for unknowns in [4, 7, 37, 130, 332, 700, 1500] {
            for rows in [1, 2, 3, 5, 9, 21, 64].map(|tiles| tiles * TILE_ROWS) {
                let (a, b) = (noise(rows, unknowns), noise(unknowns, 3 * BATCH));
                let single = |m: &Mat<f64>| Mat::from_fn(m.nrows(), m.ncols(), |i, j| m[(i, j)] as f32);
                let (a32, b32, at) = (single(&a), single(&b), a.transpose().to_owned());
                let whole = product(at.transpose(), b.as_ref());
                let mut whole32 = Mat::zeros(rows, 3 * BATCH);
                multiply(whole32.as_mut(), a32.as_ref(), b32.as_ref());
                for frames in 1..BATCH {
                    let width = (3 * frames).next_multiple_of(TILE_COLUMNS);
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
