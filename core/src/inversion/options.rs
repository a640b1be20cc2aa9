//! Choices for a solver.

use crate::handles::Handles;
use crate::regularize::Regularizer;

/// Choices for a solver.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SolverOptions {
    /// Points read.
    pub handles: Handles,
    /// Treatment of the unstable end of the spectrum.
    pub regularizer: Regularizer,
    /// Spectrum threshold s: how many of the last singular directions are regularised.
    pub spectrum: usize,
    /// Weight λ of the regularisation; α for Tikhonov.
    pub lambda: f64,
}

impl Default for SolverOptions {
    fn default() -> Self {
        Self { handles: Handles::MaxVol, regularizer: Regularizer::Laplacian, spectrum: 20, lambda: 1.0 }
    }
}
