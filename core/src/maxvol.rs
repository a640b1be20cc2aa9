//! Rows of maximum volume: the handles (Goreinov, Oseledets, Savostyanov, Tyrtyshnikov and Zamarashkin 2010).
//!
//! With `B = Φ Φ□⁻¹`, replacing handle j by row i of `Φ` multiplies the volume of `Φ□` by `|B_ij|`. Rows are swapped until no entry exceeds 1 + τ.
//! The swaps run in single precision on the candidate rows, which have an entry near one or above; a pass over all of `Φ` in double precision with a
//! fresh factorisation then confirms the result or finds further candidates.

use crate::dense;
use crate::simd::{self, multiversion};
use crate::spectrum::RANK_TOLERANCE;
use faer::reborrow::{Reborrow, ReborrowMut};
use faer::{Accum, Mat, MatRef, Par};
use rayon::prelude::*;
use std::sync::atomic::{AtomicBool, Ordering};

/// Default tolerance τ: swaps end when no entry of B exceeds 1.01.
pub const TOLERANCE: f64 = 0.01;
/// From this many columns on swaps end at [`LOOSE_TOLERANCE`].
const MANY_COLUMNS: usize = 1536;
/// Tolerance for many columns: each swap costs more there, and a basis this well conditioned is enough to interpolate and decompose by.
const LOOSE_TOLERANCE: f64 = 1.0;
/// Rows whose largest entry of B exceeds this take part in the swaps.
const CANDIDATE: f32 = 0.9;
/// Rows of one block of `B`: small enough to share the work evenly, large enough for products at full speed.
const BLOCK_ROWS: usize = 256;
/// The same for many columns, where every block's product begins with packing `Φ□⁻¹` anew.
const LARGE_BLOCK_ROWS: usize = 1024;
/// The blocks' Gram matrices are added up in a number of groups that follows from the shape alone, so that the sum does not
/// depend on the threads. They take this much memory together, unless four already take more.
const GRAM_BYTES: usize = 16 << 20;
/// From this many columns on, and up to [`MANY_COLUMNS`], the first round of swaps is hardly ever the last.
const SEVERAL_ROUNDS: usize = 512;
/// Pivots of LU above this fraction of the largest: far enough from dependent for single precision.
const SINGLE_IS_SAFE: f64 = 1e-4;
/// Bound on confirming passes; the growth of the volume keeps their number far below it.
const MAX_PASSES: usize = 64;

/// One exchange: the row of the matrix that became a handle, and which handle it replaced.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Swap {
    /// The new row.
    pub row: u32,
    /// Position of the replaced one among the picked rows.
    pub position: u32,
    /// `|B_ij|`, by which the volume grew.
    pub growth: f64,
}

/// The handles picked from a tall matrix.
#[derive(Clone, Debug)]
pub struct MaxVol {
    /// Picked rows, one per column of the matrix.
    pub rows: Vec<u32>,
    /// Rows the search started from: those of pivoted LU, or what was given.
    pub start: Vec<u32>,
    /// Number of swaps after the start.
    pub swaps: usize,
    /// These swaps, in order.
    pub trace: Vec<Swap>,
    /// `ln |det Φ□|` of the picked rows.
    pub log_volume: f64,
    /// The same for the rows the search started from.
    pub start_log_volume: f64,
    /// Largest `|B_ij|` over all rows, from a fresh factorisation after the last swap.
    pub max_entry: f64,
    /// `Bᵀ B`, m × m, symmetric.
    pub(crate) gram: Mat<f64>,
    /// `Φ□⁻¹`, m × m.
    pub(crate) inverse: Mat<f64>,
}

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

fn block_rows(columns: usize) -> usize {
    if columns < MANY_COLUMNS { BLOCK_ROWS } else { LARGE_BLOCK_ROWS }
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
    let smallest = dense::pivoted_rows(dense::rows_of(phi, &start)).smallest;
    if smallest > SINGLE_IS_SAFE { Ok(search(phi, start, tolerance)) } else { Err(DependentColumns { smallest }) }
}

fn search(phi: MatRef<'_, f64>, start: Vec<u32>, tolerance: f64) -> MaxVol {
    let mut rows = start.clone();
    let mut trace = Vec::new();
    let (mut inverse, mut log_volume) = dense::inverse(dense::rows_of(phi, &rows).as_ref());
    let start_log_volume = log_volume;
    let found = |rows, trace: Vec<Swap>, log_volume, max_entry, gram, inverse| {
        let swaps = trace.len();
        MaxVol { rows, start, swaps, trace, log_volume, start_log_volume, max_entry, gram, inverse }
    };
    let mut row_max = row_maxima(phi, inverse.as_ref());
    for pass in 0..MAX_PASSES {
        let candidates: Vec<u32> = (0..phi.nrows() as u32).filter(|&i| row_max[i as usize] > CANDIDATE).collect();
        let done = swap_among(phi, &candidates, inverse.as_ref(), tolerance, &mut rows);
        let swapped = !done.is_empty();
        trace.extend(done);
        (inverse, log_volume) = dense::inverse(dense::rows_of(phi, &rows).as_ref());
        // A pass that is about to find more rows to swap need not be exact.
        let several = (SEVERAL_ROUNDS..MANY_COLUMNS).contains(&phi.ncols());
        if swapped && (pass > 0 || several) {
            row_max = row_maxima(phi, inverse.as_ref());
            if row_max.iter().any(|&x| x > (1.0 + tolerance) as f32) {
                continue;
            }
        }
        let (maxima, gram) = maxima_and_gram(phi, inverse.as_ref(), 1.0 + tolerance);
        let max_entry = maxima.iter().copied().fold(0.0, f64::max);
        if max_entry <= 1.0 + tolerance {
            return found(rows, trace, log_volume, max_entry, gram, inverse);
        }
        row_max = maxima.iter().map(|&x| x as f32).collect();
    }
    // Not converged: reports show the largest entry.
    let (maxima, gram) = maxima_and_gram(phi, inverse.as_ref(), f64::INFINITY);
    let max_entry = maxima.iter().copied().fold(0.0, f64::max);
    found(rows, trace, log_volume, max_entry, gram, inverse)
}

/// Rows that LU with partial pivoting picks. Single precision decides the pivots as well as double does, in half the time,
/// as long as the columns are far from dependent.
///
/// # Errors
/// [`DependentColumns`] where the columns are numerically dependent.
pub fn start_rows(phi: MatRef<'_, f64>) -> Result<Vec<u32>, DependentColumns> {
    let single = dense::pivoted_rows(to_single(phi));
    if single.smallest > SINGLE_IS_SAFE {
        return Ok(single.rows);
    }
    let double = dense::pivoted_rows(phi.to_owned());
    if double.smallest > RANK_TOLERANCE {
        return Ok(double.rows);
    }
    Err(DependentColumns { smallest: double.smallest })
}

fn to_single(phi: MatRef<'_, f64>) -> Mat<f32> {
    let mut single = simd::zeros(phi.nrows(), phi.ncols());
    single.as_mut().par_col_chunks_mut(1).enumerate().for_each(|(j, mut column)| {
        for (s, &x) in column.as_mut().col_mut(0).iter_mut().zip(phi.col(j).iter()) {
            *s = x as f32;
        }
    });
    single
}

/// Largest `|B_ij|` of every row, in single precision: good enough to choose candidates by.
fn row_maxima(phi: MatRef<'_, f64>, inverse: MatRef<'_, f64>) -> Vec<f32> {
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
            dense::multiply(b.rb_mut(), single.rb(), inverse.as_ref());
            for j in 0..m {
                for (max, &x) in maxima.iter_mut().zip(b.rb().col(j).iter()) {
                    *max = if x.abs() > *max { x.abs() } else { *max };
                }
            }
        },
    );
    maxima
}

/// Largest `|B_ij|` of every row, and `Bᵀ B`, from a given `Φ□⁻¹`, without ever holding B. Once an entry exceeds `limit` the
/// Gram matrix is of no use and is left unfinished.
fn maxima_and_gram(phi: MatRef<'_, f64>, inverse: MatRef<'_, f64>, limit: f64) -> (Vec<f64>, Mat<f64>) {
    let (n, m) = phi.shape();
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
                dense::multiply(b.rb_mut(), phi.subrows(first, maxima.len()), inverse);
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
    for j in 0..m {
        for i in 0..j {
            gram[(i, j)] = gram[(j, i)];
        }
    }
    (maxima, gram)
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

/// Rows of B that take part in the swaps, row-major. Single precision: the pass that follows is in double.
struct CandidateRows {
    width: usize,
    entries: Vec<f32>,
    row_max: Vec<f32>,
}

/// Swaps rows among the candidates until no entry of theirs exceeds 1 + τ; returns the swaps.
fn swap_among(
    phi: MatRef<'_, f64>,
    candidates: &[u32],
    inverse: MatRef<'_, f64>,
    tolerance: f64,
    rows: &mut [u32],
) -> Vec<Swap> {
    let width = phi.ncols();
    let mut work = CandidateRows::gather(phi, candidates, rows, inverse);
    // Rounding of the updates must not end the swaps just above the tolerance.
    let target = (1.0 + 0.2 * tolerance) as f32;
    // Each swap multiplies the volume by more than 1 + τ, and Hadamard's inequality bounds the volume.
    let limit = 100 * width + 1000;
    let mut swaps = Vec::new();
    while swaps.len() < limit {
        let mut best = (0, 0.0);
        for (i, &max) in work.row_max.iter().enumerate() {
            if max > best.1 {
                best = (i, max);
            }
        }
        if best.1 <= target {
            break;
        }
        let row = &work.entries[best.0 * width..][..width];
        let Some(column) = row.iter().position(|x| x.abs() == best.1) else { break };
        rows[column] = candidates[best.0];
        work.exchange(best.0, column);
        swaps.push(Swap { row: rows[column], position: column as u32, growth: f64::from(best.1) });
    }
    swaps
}

impl CandidateRows {
    /// B at the candidates, for the handles `picked`, whose inverse is given.
    fn gather(phi: MatRef<'_, f64>, candidates: &[u32], picked: &[u32], inverse: MatRef<'_, f64>) -> Self {
        let width = phi.ncols();
        let mut entries = vec![0.0f32; candidates.len() * width];
        let mut row_max = vec![0.0f32; candidates.len()];
        // At the handles B is the identity.
        let mut position = vec![None; phi.nrows()];
        picked.iter().enumerate().for_each(|(j, &row)| position[row as usize] = Some(j));
        let blocks = entries.par_chunks_mut(BLOCK_ROWS * width).zip(row_max.par_chunks_mut(BLOCK_ROWS));
        blocks.zip(candidates.par_chunks(BLOCK_ROWS)).for_each(|((entries, row_max), candidates)| {
            // Transposed, so that a row of B is contiguous.
            let others: Vec<u32> = candidates.iter().copied().filter(|&i| position[i as usize].is_none()).collect();
            let rows = dense::rows_of(phi, &others);
            let b = dense::product(inverse.transpose(), rows.transpose());
            let mut columns = b.col_iter();
            for ((row, max), &i) in entries.chunks_exact_mut(width).zip(row_max).zip(candidates) {
                if let Some(j) = position[i as usize] {
                    row[j] = 1.0;
                    *max = 1.0;
                } else if let Some(column) = columns.next() {
                    for (entry, &x) in row.iter_mut().zip(column.iter()) {
                        *entry = x as f32;
                        *max = if entry.abs() > *max { entry.abs() } else { *max };
                    }
                }
            }
        });
        Self { width, entries, row_max }
    }

    /// Rank-one update of B for a swap of row `i` in for handle `j` (paper Eq. 3).
    fn exchange(&mut self, i: usize, j: usize) {
        let width = self.width;
        let pivot = self.entries[i * width + j];
        let mut direction: Vec<f32> = self.entries[i * width..][..width].to_vec();
        direction[j] -= 1.0;
        for x in &mut direction {
            *x /= pivot;
        }
        // Below this many entries another thread costs more than it saves.
        const TASK_ENTRIES: usize = 100_000;
        let rows_per_task = (TASK_ENTRIES / width).max(1);
        self.entries
            .par_chunks_mut(rows_per_task * width)
            .zip(self.row_max.par_chunks_mut(rows_per_task))
            .for_each(|(entries, row_max)| update_rows(entries, row_max, &direction, j));
    }
}

multiversion! {
    fn update_rows(entries: &mut [f32], row_max: &mut [f32], direction: &[f32], column: usize) = update_rows_generic;
}

#[inline(always)]
fn update_rows_generic(entries: &mut [f32], row_max: &mut [f32], direction: &[f32], column: usize) {
    const WIDE: usize = 16;
    for (row, max) in entries.chunks_exact_mut(direction.len()).zip(row_max) {
        let factor = row[column];
        // Rows of other handles, among many, are left as they are.
        if factor == 0.0 {
            continue;
        }
        let mut lanes = [0.0f32; WIDE];
        let mut chunks = row.chunks_exact_mut(WIDE);
        let mut steps = direction.chunks_exact(WIDE);
        for (chunk, step) in (&mut chunks).zip(&mut steps) {
            for l in 0..WIDE {
                chunk[l] -= factor * step[l];
                let size = chunk[l].abs();
                lanes[l] = if size > lanes[l] { size } else { lanes[l] };
            }
        }
        let mut largest = 0.0;
        for (x, step) in chunks.into_remainder().iter_mut().zip(steps.remainder()) {
            *x -= factor * step;
            largest = if x.abs() > largest { x.abs() } else { largest };
        }
        for size in lanes {
            largest = if size > largest { size } else { largest };
        }
        *max = largest;
    }
}
