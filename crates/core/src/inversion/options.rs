//! Options of a solver.

use super::Handles;
use crate::regularize::Regularizer;

/// Options of a solver.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SolverOptions {
    /// Points read.
    pub handles: Handles,
    /// Treatment of the unstable end of the spectrum.
    pub regularizer: Regularizer,
    /// Spectrum threshold s: how many of the last singular directions are regularised.
    pub spectrum: usize,
    /// Weight λ of the regularisation beside the mean square error of the points in the data term; α for Tikhonov; the truncated SVD does not use it.
    /// 0 is the same as a threshold of 0.
    pub lambda: f64,
}

/// Largest default number of regularised singular directions: the paper's threshold.
const DEFAULT_SPECTRUM: usize = 20;

impl SolverOptions {
    /// The method of the paper (Thiery et al. 2012): as many points as unknowns, of maximum volume, and the cage's Laplacian.
    pub const PAPER: Self =
        Self { handles: Handles::MaxVol, regularizer: Regularizer::Laplacian, spectrum: DEFAULT_SPECTRUM, lambda: 1.0 };

    /// Without a regularisation term whose λ is zero, which is the same as a threshold of zero.
    pub(crate) fn without_idle_term(self) -> Self {
        if self.lambda > 0.0 {
            return self;
        }
        let usual = Self { spectrum: 0, lambda: Self::default().lambda, ..self };
        match self.regularizer {
            Regularizer::Global => Self { regularizer: Regularizer::None, ..usual },
            regularizer if regularizer.is_sub_spectral() => usual,
            _ => self,
        }
    }

    /// Default options for a cage of so many unknowns.
    pub fn for_unknowns(unknowns: usize) -> Self {
        Self { spectrum: default_spectrum(unknowns), ..Self::default() }
    }
}

/// Default spectrum threshold of a cage of m unknowns: min(20, m/16), so that coarse cages keep most of their freedom.
pub fn default_spectrum(unknowns: usize) -> usize {
    DEFAULT_SPECTRUM.min(unknowns / 16)
}

impl Default for SolverOptions {
    fn default() -> Self {
        Self {
            handles: Handles::default(),
            regularizer: Regularizer::default(),
            spectrum: DEFAULT_SPECTRUM,
            lambda: 1.0,
        }
    }
}
