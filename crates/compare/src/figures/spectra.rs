//! Singular values of `Φ□`, `Φ` and `ΦᵀΦ` (the paper's Figs. 6 and 9), and where the singular
//! vectors of `Φ□` live on the cage (Figs. 11 and 15).

use cager_core::spectral::Analysis;
use serde::Serialize;

/// Singular values, descending, and condition numbers over the numerical rank.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct Spectra {
    /// Of the handles' rows `Φ□`.
    pub(crate) handles: Vec<f64>,
    pub(crate) full: Vec<f64>,
    pub(crate) condition_handles: f64,
    pub(crate) condition_full: f64,
    pub(crate) condition_normal: f64,
}

impl Spectra {
    pub(crate) fn of(analysis: &Analysis) -> Self {
        let found = analysis.preparation();
        Self {
            handles: analysis.handle_spectrum().to_vec(),
            full: analysis.full_spectrum().to_vec(),
            condition_handles: found.condition_handles,
            condition_full: found.condition_full,
            condition_normal: found.condition_full * found.condition_full,
        }
    }
}

/// Vectors painted from the beginning and from the end.
const FIRST: usize = 3;
const LAST: usize = 5;

/// Singular vectors of `Φ□`.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct Vectors {
    /// Participation number `1 / Σ v⁴` of every singular direction: m for a vector spread evenly, 1
    /// for one on a single unknown.
    pub(crate) spread: Vec<f64>,
    /// Mean of these over the first and over the last tenth.
    pub(crate) spread_first: f64,
    pub(crate) spread_last: f64,
    /// Those the report paints, from 0.
    pub(crate) painted: Vec<usize>,
}

impl Vectors {
    pub(crate) fn of(analysis: &Analysis) -> Self {
        let v = analysis.handle_vectors();
        let m = v.ncols();
        let spread: Vec<f64> = (0..m).map(|k| 1.0 / v.col(k).iter().map(|x| x.powi(4)).sum::<f64>()).collect();
        let tenth = m.div_ceil(10);
        let mean = |part: &[f64]| part.iter().sum::<f64>() / part.len() as f64;
        let (spread_first, spread_last) = (mean(&spread[..tenth]), mean(&spread[m - tenth..]));
        Self { spread, spread_first, spread_last, painted: painted(m) }
    }
}

/// The first and the last of m, each once.
fn painted(m: usize) -> Vec<usize> {
    let first = FIRST.min(m);
    (0..first).chain(m.saturating_sub(LAST).max(first)..m).collect()
}

#[cfg(test)]
mod tests {
    use super::painted;

    #[test]
    fn no_vector_is_painted_twice() {
        for m in 1..9 {
            assert_eq!(painted(m), (0..m).collect::<Vec<_>>());
        }
        assert_eq!(painted(10), [0, 1, 2, 5, 6, 7, 8, 9]);
    }
}
