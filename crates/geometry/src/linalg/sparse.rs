//! Sparse matrices, as they are given.

use super::svd::{Svd, svd};
use faer::Mat;

/// Larger entries overflow where they are squared.
const LARGEST: f64 = 1e100;

/// A sparse matrix Δ, for terms `‖Δ C‖²`.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SparseMatrix {
    rows: usize,
    columns: usize,
    /// Row, column, value; by row, then column, each place once.
    entries: Vec<(u32, u32, f64)>,
}

impl SparseMatrix {
    /// Takes entries (row, column, value) in any order; those of the same place are added up.
    /// `None` where one lies outside, is not finite or beyond 1e100.
    pub fn new(rows: usize, columns: usize, mut entries: Vec<(u32, u32, f64)>) -> Option<Self> {
        let inside = |&(i, j, _): &(u32, u32, f64)| (i as usize) < rows && (j as usize) < columns;
        if !entries.iter().all(inside) {
            return None;
        }
        // Stable, so that sums do not depend on anything but the order given.
        entries.sort_by_key(|&(i, j, _)| (i, j));
        entries.dedup_by(|next, kept| {
            let same = (next.0, next.1) == (kept.0, kept.1);
            if same {
                kept.2 += next.2;
            }
            same
        });
        entries.iter().all(|entry| entry.2.abs() <= LARGEST).then_some(Self { rows, columns, entries })
    }

    /// Number of rows.
    pub fn rows(&self) -> usize {
        self.rows
    }

    /// Number of columns.
    pub fn columns(&self) -> usize {
        self.columns
    }

    /// Entries (row, column, value) by row, then column.
    pub fn entries(&self) -> &[(u32, u32, f64)] {
        &self.entries
    }

    /// A matrix with the same `‖Δ C‖` for every C, of at most four times as many rows as
    /// `unknowns`, beyond which no entry lies.
    pub fn compressed(&self, unknowns: usize) -> Mat<f64> {
        let rows: Vec<&[(u32, u32, f64)]> = self.entries.chunk_by(|a, b| a.0 == b.0).collect();
        let mut delta = Mat::zeros(rows.len().min(4 * unknowns), unknowns);
        if rows.len() <= 4 * unknowns {
            for (i, row) in rows.iter().enumerate() {
                row.iter().for_each(|&(_, j, x)| delta[(i, j as usize)] = x);
            }
            return delta;
        }
        // The solve that follows squares Δ as well, so that nothing is lost by doing it here.
        let mut gram = Mat::<f64>::zeros(unknowns, unknowns);
        for row in rows {
            for &(_, i, x) in row {
                row.iter().for_each(|&(_, j, y)| gram[(i as usize, j as usize)] += x * y);
            }
        }
        match svd(gram.as_ref()) {
            Some(Svd { sigma, v, .. }) => Mat::from_fn(unknowns, unknowns, |i, j| sigma[i].sqrt() * v[(j, i)]),
            // Squares overflow; the solve then reports the failure.
            None => Mat::full(1, unknowns, f64::NAN),
        }
    }
}
