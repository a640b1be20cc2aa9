//! Swaps of rows, in single precision, among the rows that may take part in them.

use crate::simd::multiversion;
use cager_geometry::linalg;
use faer::MatRef;
use rayon::prelude::*;

/// Rows of B whose largest entry exceeds this take part in the swaps.
const CANDIDATE: f32 = 0.9;
/// Candidates of one task when their rows of B are computed.
const TASK_ROWS: usize = 256;

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

/// The rows that take part, from the largest entry of every row.
pub(super) fn candidates(row_max: &[f32]) -> Vec<u32> {
    (0..row_max.len() as u32).filter(|&i| row_max[i as usize] > CANDIDATE).collect()
}

/// Rows of B that take part in the swaps, row-major, in single precision.
pub(super) struct CandidateRows {
    /// Which rows they are.
    rows: Vec<u32>,
    width: usize,
    entries: Vec<f32>,
    row_max: Vec<f32>,
}

impl CandidateRows {
    /// B at the candidates, for the handles `picked`, whose inverse is given.
    pub(super) fn new(phi: MatRef<'_, f64>, candidates: Vec<u32>, picked: &[u32], inverse: MatRef<'_, f64>) -> Self {
        let width = phi.ncols();
        let mut entries = vec![0.0f32; candidates.len() * width];
        let mut row_max = vec![0.0f32; candidates.len()];
        // At the handles B is the identity.
        let mut position = vec![None; phi.nrows()];
        picked.iter().enumerate().for_each(|(j, &row)| position[row as usize] = Some(j));
        let blocks = entries.par_chunks_mut(TASK_ROWS * width).zip(row_max.par_chunks_mut(TASK_ROWS));
        blocks.zip(candidates.par_chunks(TASK_ROWS)).for_each(|((entries, row_max), candidates)| {
            // Transposed, so that a row of B is contiguous.
            let others: Vec<u32> = candidates.iter().copied().filter(|&i| position[i as usize].is_none()).collect();
            let rows = linalg::rows_of(phi, &others);
            let b = linalg::product(inverse.transpose(), rows.transpose());
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
        Self { rows: candidates, width, entries, row_max }
    }

    /// Swaps rows until no entry exceeds 1 + τ, and returns the swaps. `picked` are the handles.
    pub(super) fn swap(mut self, picked: &mut [u32], tolerance: f64) -> Vec<Swap> {
        // Rounding of the updates must not end the swaps just above the tolerance.
        let target = (1.0 + 0.2 * tolerance) as f32;
        // Each swap multiplies the volume by more than 1 + τ, and Hadamard's inequality bounds it.
        let limit = 100 * self.width + 1000;
        let mut swaps = Vec::new();
        while swaps.len() < limit {
            let mut best = (0, 0.0);
            for (i, &max) in self.row_max.iter().enumerate() {
                if max > best.1 {
                    best = (i, max);
                }
            }
            if best.1 <= target {
                break;
            }
            let row = &self.entries[best.0 * self.width..][..self.width];
            let Some(column) = row.iter().position(|x| x.abs() == best.1) else { break };
            picked[column] = self.rows[best.0];
            self.exchange(best.0, column);
            swaps.push(Swap { row: picked[column], position: column as u32, growth: f64::from(best.1) });
        }
        swaps
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
    fn update_rows(entries: &mut [f32], row_max: &mut [f32], direction: &[f32], column: usize) {
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
}
