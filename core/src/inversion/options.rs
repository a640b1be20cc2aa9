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
    /// Weight λ of the regularisation beside the mean square error of the points in the data term; α for Tikhonov. 0 is the same as a
    /// threshold of 0.
    pub lambda: f64,
}

/// Singular directions that are regularised where nothing else is asked for, at the most: the paper's threshold.
const USUAL_SPECTRUM: usize = 20;

impl SolverOptions {
    /// The method of the paper (Thiery et al. 2012): as many points as unknowns, of maximum volume, and the cage's Laplacian.
    pub const PAPER: Self =
        Self { handles: Handles::MaxVol, regularizer: Regularizer::Laplacian, spectrum: USUAL_SPECTRUM, lambda: 1.0 };

    /// What is chosen for a cage of so many unknowns where nothing else is asked for.
    pub fn usual(unknowns: usize) -> Self {
        Self { spectrum: usual_spectrum(unknowns), ..Self::default() }
    }
}

/// The spectrum threshold of a cage of so many unknowns where none is given, min(20, m/16): 20 of 58 directions would be a third
/// of all it can do.
pub fn usual_spectrum(unknowns: usize) -> usize {
    USUAL_SPECTRUM.min(unknowns / 16)
}

impl Default for SolverOptions {
    fn default() -> Self {
        Self { handles: Handles::default(), regularizer: Regularizer::default(), spectrum: USUAL_SPECTRUM, lambda: 1.0 }
    }
}
