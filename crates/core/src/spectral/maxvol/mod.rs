//! Rows of maximum volume: the handles (Goreinov, Oseledets, Savostyanov et al. 2010).
//!
//! With `B = Φ Φ□⁻¹`, replacing handle j by row i of `Φ` multiplies the volume of `Φ□` by `|B_ij|`.
//! Rows are swapped until no entry exceeds 1 + τ: in single precision on candidate rows, which have
//! an entry near one or above; a pass over all of `Φ` in double precision then confirms the result
//! or finds further candidates.

mod swaps;

pub use swaps::Swap;

use super::normal_factor::RANK_TOLERANCE;
use cager_geometry::linalg;
use faer::reborrow::{Reborrow, ReborrowMut};
use faer::traits::RealField;
use faer::{Mat, MatRef};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::ops::Neg;
use swaps::{CandidateRows, candidates};

/// From this many columns on swaps end at [`LOOSE_TOLERANCE`].
const MANY_COLUMNS: usize = 1536;
/// Tolerance for many columns, where each swap costs more: a good enough basis.
const LOOSE_TOLERANCE: f64 = 1.0;
/// Pivots of LU above this fraction of the largest: far enough from dependent for single precision.
const SINGLE_IS_SAFE: f64 = 1e-4;
/// Bound on confirming passes; the growth of the volume keeps their number far below it.
const MAX_PASSES: usize = 64;
/// Rows of one block of `B`: small enough to share the work, large enough for full speed.
const BLOCK_ROWS: usize = 256;
/// The same for many columns, where every block's product begins with packing `Φ□⁻¹` anew.
const LARGE_BLOCK_ROWS: usize = 1024;

/// How a search went. Stored in reports: the names of fields are part of the format.
#[derive(Clone, Copy, Debug, Default, Deserialize, PartialEq, Serialize)]
#[serde(default)]
pub struct Volume {
    /// Swaps after the start.
    pub swaps: usize,
    /// `ln |det Φ□|`.
    #[serde(deserialize_with = "crate::numbers::number_or_null")]
    pub log_volume: f64,
    /// Largest `|B_ij|` of `Φ = B Φ□` after the last swap.
    #[serde(deserialize_with = "crate::numbers::number_or_null")]
    pub max_entry: f64,
}

/// The handles picked from a tall matrix.
#[derive(Clone, Debug)]
pub struct MaxVol {
    /// Picked rows, one per column of the matrix.
    pub rows: Vec<u32>,
    /// Rows the search started from: those of pivoted LU, or what was given.
    pub start: Vec<u32>,
    /// How the search went; `max_entry` is from a fresh factorisation.
    pub volume: Volume,
    /// The swaps, in order.
    pub trace: Vec<Swap>,
    /// `ln |det Φ□|` of the rows the search started from.
    pub start_log_volume: f64,
    /// `Φ□⁻¹`, m × m.
    pub(crate) inverse: Mat<f64>,
}

/// Default tolerance τ: swaps end when no entry of B exceeds 1.01.
pub const TOLERANCE: f64 = 0.01;

/// The matrix has no m linearly independent rows to the working precision.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error("the coordinate matrix has dependent columns (smallest pivot {smallest:.1e} of the largest)")]
pub struct DependentColumns {
    /// Smallest pivot of the LU factorisation, relative to the largest.
    pub smallest: f64,
}

/// Tolerance τ for so many unknowns: [`TOLERANCE`], and a looser one from 1,536 on.
pub fn tolerance(unknowns: usize) -> f64 {
    if unknowns < MANY_COLUMNS { TOLERANCE } else { LOOSE_TOLERANCE }
}

/// Picks m rows of the n × m matrix `phi` such that no exchange enlarges their volume by more than
/// 1 + τ. Deterministic: ties go to the smallest row, then the smallest column.
pub fn maxvol(phi: MatRef<'_, f64>, tolerance: f64) -> Result<MaxVol, DependentColumns> {
    Ok(search(phi, start_rows(phi)?, tolerance))
}

/// As [`maxvol`], from m given rows; refused where these are nearly dependent.
///
/// # Panics
/// Where there are not as many rows as columns.
pub fn maxvol_from(phi: MatRef<'_, f64>, start: Vec<u32>, tolerance: f64) -> Result<MaxVol, DependentColumns> {
    assert_eq!(start.len(), phi.ncols(), "as many rows as columns");
    let smallest = linalg::pivoted(linalg::rows_of(phi, &start)).smallest;
    if smallest > SINGLE_IS_SAFE { Ok(search(phi, start, tolerance)) } else { Err(DependentColumns { smallest }) }
}

fn search(phi: MatRef<'_, f64>, start: Vec<u32>, tolerance: f64) -> MaxVol {
    let mut rows = start.clone();
    let mut trace = Vec::new();
    let (mut inverse, mut log_volume) = linalg::inverse(linalg::rows_of(phi, &rows).as_ref());
    let start_log_volume = log_volume;
    let single = |inverse: &Mat<f64>| row_maxima(phi, inverse.as_ref(), |x| x as f32);
    let mut row_max = single(&inverse);
    let mut max_entry = f64::NAN;
    for _ in 0..MAX_PASSES {
        let candidates = CandidateRows::new(phi, candidates(&row_max), &rows, inverse.as_ref());
        trace.extend(candidates.swap(&mut rows, tolerance));
        (inverse, log_volume) = linalg::inverse(linalg::rows_of(phi, &rows).as_ref());
        // A pass that is about to find more rows to swap need not be exact.
        row_max = single(&inverse);
        if row_max.iter().any(|&x| x > (1.0 + tolerance) as f32) {
            continue;
        }
        let maxima = row_maxima(phi, inverse.as_ref(), |x| x);
        max_entry = maxima.iter().copied().fold(0.0, f64::max);
        if max_entry <= 1.0 + tolerance {
            break;
        }
        row_max = maxima.iter().map(|&x| x as f32).collect();
    }
    let volume = Volume { swaps: trace.len(), log_volume, max_entry };
    MaxVol { rows, start, volume, trace, start_log_volume, inverse }
}

/// Rows that LU with partial pivoting picks, in single precision where that is safe.
pub fn start_rows(phi: MatRef<'_, f64>) -> Result<Vec<u32>, DependentColumns> {
    let single = linalg::pivoted(linalg::to_single(phi, phi.nrows()));
    if single.smallest > SINGLE_IS_SAFE {
        return Ok(single.rows().to_vec());
    }
    let double = linalg::pivoted(phi.to_owned());
    if double.smallest > RANK_TOLERANCE {
        return Ok(double.rows().to_vec());
    }
    Err(DependentColumns { smallest: double.smallest })
}

/// Largest `|B_ij|` of every row in the precision of `number`.
fn row_maxima<T: RealField + Copy + PartialOrd + Neg<Output = T>>(
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
