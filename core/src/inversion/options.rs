//! Choices for a solver.

use crate::regularize::Regularizer;

/// Which points the inversion reads.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Handles {
    /// As many as unknowns, of maximum volume: stable, and a frame costs microseconds.
    #[default]
    MaxVol,
    /// Every point: least squares, the lowest error.
    All,
}

impl Handles {
    /// The name on the command line, in reports and in containers.
    pub fn name(self) -> &'static str {
        match self {
            Self::MaxVol => "maxvol",
            Self::All => "all",
        }
    }
}

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
