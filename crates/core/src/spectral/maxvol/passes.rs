//! Passes over all rows of `B = Φ Φ□⁻¹`, without ever holding B.

use super::handles::MANY_COLUMNS;
use cager_geometry::linalg;
use faer::reborrow::{Reborrow, ReborrowMut};
use faer::traits::RealField;
use faer::{Mat, MatRef};
use rayon::prelude::*;
use std::ops::Neg;

/// Rows of one block of `B`: small enough to share the work evenly, large enough for products at full speed.
const BLOCK_ROWS: usize = 256;
/// The same for many columns, where every block's product begins with packing `Φ□⁻¹` anew.
const LARGE_BLOCK_ROWS: usize = 1024;

/// Largest `|B_ij|` of every row, computed in the precision to which `number` converts: single is good enough to choose candidates by.
pub(super) fn row_maxima<T: RealField + Copy + PartialOrd + Neg<Output = T>>(
    phi: MatRef<'_, f64>,
    inverse: MatRef<'_, f64>,
    number: impl Fn(f64) -> T + Sync,
) -> Vec<T> {
    let (n, m) = phi.shape();
    let block_rows = if m < MANY_COLUMNS { BLOCK_ROWS } else { LARGE_BLOCK_ROWS };
    let inverse = Mat::<T>::from_fn(m, m, |i, j| number(inverse[(i, j)]));
    let zero = number(0.0);
    let mut maxima = vec![zero; n];
    maxima.par_chunks_mut(block_rows).enumerate().for_each_init(
        || (Mat::<T>::zeros(block_rows, m), Mat::<T>::zeros(block_rows, m)),
        |(converted, b), (block, maxima)| {
            let rows = phi.subrows(block * block_rows, maxima.len());
            let mut converted = converted.as_mut().subrows_mut(0, maxima.len());
            for j in 0..m {
                for (to, &x) in converted.rb_mut().col_mut(j).iter_mut().zip(rows.col(j).iter()) {
                    *to = number(x);
                }
            }
            let mut b = b.as_mut().subrows_mut(0, maxima.len());
            linalg::multiply(b.rb_mut(), converted.rb(), inverse.as_ref());
            for j in 0..m {
                for (max, x) in maxima.iter_mut().zip(b.rb().col(j).iter()) {
                    let size = if *x < zero { -*x } else { *x };
                    *max = if size > *max { size } else { *max };
                }
            }
        },
    );
    maxima
}
