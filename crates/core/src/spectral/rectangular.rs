//! More rows than columns by leverage: rectangular maximum volume (Mikhalev and Oseledets 2018).
//!
//! Row i multiplies the volume `det(Φ_Sᵀ Φ_S)^½` by `(1 + ℓ_i)^½` with the leverage `ℓ_i = φ_i
//! (Φ_Sᵀ Φ_S)⁻¹ φ_iᵀ`; the greedy choice is the largest. Leverages only fall as rows are added: old
//! ones are bounds, and few are computed anew.

use super::row_basis::RowBasis;
use cager_geometry::linalg;
use faer::{Mat, MatRef};
use rayon::prelude::*;
use std::cmp::Ordering;
use std::collections::BinaryHeap;

const BLOCK_ROWS: usize = 256;

/// A row with a bound of its leverage, and how many rows had been added when that was computed.
struct Bound {
    leverage: f64,
    row: u32,
    added: usize,
}

impl Ord for Bound {
    fn cmp(&self, other: &Self) -> Ordering {
        self.leverage.total_cmp(&other.leverage).then(other.row.cmp(&self.row))
    }
}

impl PartialOrd for Bound {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for Bound {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

impl Eq for Bound {}

/// The rows of maximum volume and those added to them until there are `count`.
pub(crate) fn rectangular_rows(phi: MatRef<'_, f64>, basis: &RowBasis, count: usize) -> Vec<u32> {
    let r = basis.rank;
    let mut rows = basis.handles.rows.clone();
    let taken: std::collections::HashSet<u32> = rows.iter().copied().collect();
    let mut bounds: BinaryHeap<Bound> = row_norms(phi, basis.to_basis.as_ref())
        .into_iter()
        .zip(0..)
        .filter(|(_, row)| !taken.contains(row))
        .map(|(leverage, row)| Bound { leverage, row, added: 0 })
        .collect();
    // (B_Sᵀ B_S)⁻¹, which begins as the identity: B is the identity at the rows of maximum volume.
    let mut inverse = Mat::<f64>::identity(r, r);
    let mut added = 0;
    while rows.len() < count {
        let Some(top) = bounds.pop() else { break };
        let b = linalg::product(linalg::rows_of(phi, &[top.row]).as_ref(), basis.to_basis.as_ref());
        let direction = linalg::product(inverse.as_ref(), b.transpose());
        let leverage = (0..r).map(|j| b[(0, j)] * direction[(j, 0)]).sum();
        if top.added < added {
            bounds.push(Bound { leverage, added, ..top });
            continue;
        }
        rows.push(top.row);
        added += 1;
        for j in 0..r {
            let share = direction[(j, 0)] / (1.0 + leverage);
            for i in 0..r {
                inverse[(i, j)] -= share * direction[(i, 0)];
            }
        }
    }
    rows
}

/// `|b_i|²` for every row of `B = Φ · to_basis`.
fn row_norms(phi: MatRef<'_, f64>, to_basis: MatRef<'_, f64>) -> Vec<f64> {
    let mut norms = vec![0.0; phi.nrows()];
    norms.par_chunks_mut(BLOCK_ROWS).enumerate().for_each_init(
        || Mat::<f64>::zeros(BLOCK_ROWS, to_basis.ncols()),
        |b, (block, norms)| {
            let mut b = b.as_mut().subrows_mut(0, norms.len());
            linalg::multiply(b.as_mut(), phi.subrows(block * BLOCK_ROWS, norms.len()), to_basis);
            for j in 0..to_basis.ncols() {
                for (norm, &x) in norms.iter_mut().zip(b.as_ref().col(j).iter()) {
                    *norm += x * x;
                }
            }
        },
    );
    norms
}
