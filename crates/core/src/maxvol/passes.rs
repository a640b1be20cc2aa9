//! Passes over all rows of `B = Φ Φ□⁻¹`, without ever holding B.

use super::handles::MANY_COLUMNS;
use cager_geometry::linalg;
use faer::reborrow::{Reborrow, ReborrowMut};
use faer::{Accum, Mat, MatRef, Par};
use rayon::prelude::*;
use std::sync::atomic::{AtomicBool, Ordering};

/// Rows of one block of `B`: small enough to share the work evenly, large enough for products at full speed.
const BLOCK_ROWS: usize = 256;
/// The same for many columns, where every block's product begins with packing `Φ□⁻¹` anew.
const LARGE_BLOCK_ROWS: usize = 1024;
/// The blocks' Gram matrices are added up in a number of groups that follows from the shape alone, so that the sum does not
/// depend on the threads. They take this much memory together, unless four already take more.
const GRAM_BYTES: usize = 16 << 20;

fn block_rows(columns: usize) -> usize {
    if columns < MANY_COLUMNS { BLOCK_ROWS } else { LARGE_BLOCK_ROWS }
}

/// Largest `|B_ij|` of every row, in single precision: good enough to choose candidates by.
pub(super) fn row_maxima(phi: MatRef<'_, f64>, inverse: MatRef<'_, f64>) -> Vec<f32> {
    let (n, m) = phi.shape();
    let block_rows = block_rows(m);
    let inverse = Mat::<f32>::from_fn(m, m, |i, j| inverse[(i, j)] as f32);
    let mut maxima = vec![0.0f32; n];
    maxima.par_chunks_mut(block_rows).enumerate().for_each_init(
        || (Mat::<f32>::zeros(block_rows, m), Mat::<f32>::zeros(block_rows, m)),
        |(single, b), (block, maxima)| {
            let rows = phi.subrows(block * block_rows, maxima.len());
            let mut single = single.as_mut().subrows_mut(0, maxima.len());
            for j in 0..m {
                for (s, &x) in single.rb_mut().col_mut(j).iter_mut().zip(rows.col(j).iter()) {
                    *s = x as f32;
                }
            }
            let mut b = b.as_mut().subrows_mut(0, maxima.len());
            linalg::multiply(b.rb_mut(), single.rb(), inverse.as_ref());
            for j in 0..m {
                for (max, &x) in maxima.iter_mut().zip(b.rb().col(j).iter()) {
                    *max = if x.abs() > *max { x.abs() } else { *max };
                }
            }
        },
    );
    maxima
}

/// Largest `|B_ij|` of every row, and `Bᵀ B`, from a given `Φ□⁻¹`, or what takes its place where `Φ` has a smaller rank, without ever holding B. Once an entry exceeds `limit` the
/// Gram matrix is of no use and is left unfinished.
pub(crate) fn maxima_and_gram(phi: MatRef<'_, f64>, inverse: MatRef<'_, f64>, limit: f64) -> (Vec<f64>, Mat<f64>) {
    let (n, m) = (phi.nrows(), inverse.ncols());
    let block_rows = block_rows(m);
    let mut maxima = vec![0.0f64; n];
    let groups = (GRAM_BYTES / (8 * m * m)).clamp(4, 16);
    let blocks_per_group = n.div_ceil(block_rows).div_ceil(groups);
    let exceeded = AtomicBool::new(false);
    let grams: Vec<Mat<f64>> = maxima
        .par_chunks_mut(blocks_per_group * block_rows)
        .enumerate()
        .map(|(group, maxima)| {
            let mut gram = Mat::zeros(m, m);
            let mut b = Mat::zeros(block_rows.min(maxima.len()), m);
            for (k, maxima) in maxima.chunks_mut(block_rows).enumerate() {
                let first = (group * blocks_per_group + k) * block_rows;
                let mut b = b.as_mut().subrows_mut(0, maxima.len());
                linalg::multiply(b.rb_mut(), phi.subrows(first, maxima.len()), inverse);
                for j in 0..m {
                    for (max, &x) in maxima.iter_mut().zip(b.rb().col(j).iter()) {
                        *max = if x.abs() > *max { x.abs() } else { *max };
                    }
                }
                if maxima.iter().any(|&x| x > limit) {
                    exceeded.store(true, Ordering::Relaxed);
                }
                if !exceeded.load(Ordering::Relaxed) {
                    add_gram(&mut gram, b.rb());
                }
            }
            gram
        })
        .collect();
    let mut gram = Mat::zeros(m, m);
    for part in &grams {
        gram += part;
    }
    (maxima, linalg::mirrored(gram))
}

/// Adds `bᵀ b` to the lower triangle.
fn add_gram(gram: &mut Mat<f64>, b: MatRef<'_, f64>) {
    use faer::linalg::matmul::triangular::{BlockStructure, matmul};
    matmul(
        gram.as_mut(),
        BlockStructure::TriangularLower,
        Accum::Add,
        b.transpose(),
        BlockStructure::Rectangular,
        b,
        BlockStructure::Rectangular,
        1.0,
        Par::Seq,
    );
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_gram_matrix_is_that_of_the_basis_whatever_its_rank() {
        let phi = Mat::from_fn(700, 9, |i, j| ((i * 31 + j * 17 + i * j) % 23) as f64 - 11.0);
        for rank in [9, 5] {
            let to_basis = Mat::from_fn(9, rank, |i, j| ((3 * i + 7 * j) % 5) as f64 - 2.0);
            let (maxima, gram) = maxima_and_gram(phi.as_ref(), to_basis.as_ref(), f64::INFINITY);
            let b = linalg::product(phi.as_ref(), to_basis.as_ref());
            assert_eq!(gram, linalg::product(b.transpose(), b.as_ref()), "integers are exact");
            assert_eq!(maxima[3], b.as_ref().row(3).norm_max());
        }
    }
}
