//! Singular values of `Φ□`, `Φ` and `ΦᵀΦ` (the paper's Figs. 6 and 9).

use cager_core::spectral::Analysis;
use serde::Serialize;

/// Singular values, descending, and condition numbers over the numerical rank. Those of `ΦᵀΦ` are the squares of those of `Φ`.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct Spectra {
    /// Of the handles' rows `Φ□`.
    pub(crate) handles: Vec<f64>,
    /// Of `Φ`.
    pub(crate) full: Vec<f64>,
    /// Condition number of `Φ□`.
    pub(crate) condition_handles: f64,
    /// Condition number of `Φ`.
    pub(crate) condition_full: f64,
    /// Condition number of `ΦᵀΦ`.
    pub(crate) condition_normal: f64,
}

impl Spectra {
    /// Of an analysis.
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
