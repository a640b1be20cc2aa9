//! Rows of maximum volume: the handles (Goreinov, Oseledets, Savostyanov, Tyrtyshnikov and Zamarashkin 2010).
//!
//! With `B = Φ Φ□⁻¹`, replacing handle j by row i of `Φ` multiplies the volume of `Φ□` by `|B_ij|`. Rows are swapped until no entry exceeds 1 + τ.
//! The swaps run in single precision on the candidate rows, which have an entry near one or above; a pass over all of `Φ` in double precision with a
//! fresh factorisation then confirms the result or finds further candidates.

mod handles;
mod passes;
mod swaps;

pub use handles::{MaxVol, Swap, Volume};

use super::normal_factor::RANK_TOLERANCE;
use cager_geometry::linalg;
use faer::{Mat, MatRef};
use handles::{LOOSE_TOLERANCE, MANY_COLUMNS, MAX_PASSES, SINGLE_IS_SAFE};
use passes::row_maxima;
use swaps::{CandidateRows, candidates};

/// Default tolerance τ: swaps end when no entry of B exceeds 1.01.
pub const TOLERANCE: f64 = 0.01;

/// The matrix has no m linearly independent rows to the working precision.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error("the coordinate matrix has dependent columns (smallest pivot {smallest:.1e} of the largest)")]
pub struct DependentColumns {
    /// Smallest pivot of the LU factorisation, relative to the largest.
    pub smallest: f64,
}

/// Tolerance τ for a cage of so many unknowns: [`TOLERANCE`], and a looser one from 1,536 unknowns on.
pub fn tolerance(unknowns: usize) -> f64 {
    if unknowns < MANY_COLUMNS { TOLERANCE } else { LOOSE_TOLERANCE }
}

/// Picks m rows of the n × m matrix `phi`, n ≥ m, such that no single exchange enlarges their volume by more than 1 + τ.
///
/// Deterministic: ties go to the smallest row, then the smallest column, and the threads of the pool do not matter.
///
/// # Errors
/// [`DependentColumns`] where the columns are numerically dependent.
pub fn maxvol(phi: MatRef<'_, f64>, tolerance: f64) -> Result<MaxVol, DependentColumns> {
    Ok(search(phi, start_rows(phi)?, tolerance))
}

/// As [`maxvol`], from m given rows instead of those of pivoted LU.
///
/// # Errors
/// [`DependentColumns`] where these rows are dependent, or so close to it that swaps in single precision would follow rounding.
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
        let candidates = CandidateRows::computed(phi, candidates(&row_max), &rows, inverse.as_ref());
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

/// Rows that LU with partial pivoting picks. Single precision decides the pivots as well as double does, in half the time,
/// as long as the columns are far from dependent.
///
/// # Errors
/// [`DependentColumns`] where the columns are numerically dependent.
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
