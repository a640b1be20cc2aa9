//! Options of a solver; `docs/PAPER.md` compares the errors of handles.

use crate::regularize::Regularizer;

/// Which points the inversion reads.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Handles {
    /// As many rows as unknowns, of maximum volume: well-conditioned, microseconds per frame.
    MaxVol,
    /// Those rows and others of largest leverage (Mikhalev and Oseledets 2018): for comparison.
    Rectangular {
        /// Rows read, K; 2m where none is given.
        count: Option<usize>,
    },
    /// Those rows and farthest-point samples, from which the other points are interpolated by
    /// kriging: close to [`Self::All`].
    Spread {
        /// Rows read, K; 2m where none is given.
        count: Option<usize>,
    },
    /// Every point: least squares, the lowest error.
    All,
}

impl Default for Handles {
    /// Spread handles, two for each unknown.
    fn default() -> Self {
        Self::Spread { count: None }
    }
}

impl Handles {
    /// The names, in the order of the documentation.
    pub const NAMES: [&'static str; 4] = ["maxvol", "rectangular", "spread", "all"];

    /// The variant with this name, reading `count` rows, if there is one.
    pub fn by_name(name: &str, count: Option<usize>) -> Option<Self> {
        match (name, count) {
            ("maxvol", None) => Some(Self::MaxVol),
            ("all", None) => Some(Self::All),
            ("rectangular", count) => Some(Self::Rectangular { count }),
            ("spread", count) => Some(Self::Spread { count }),
            _ => None,
        }
    }

    /// The name on the command line, in reports and in containers.
    pub fn name(self) -> &'static str {
        match self {
            Self::MaxVol => "maxvol",
            Self::Rectangular { .. } => "rectangular",
            Self::Spread { .. } => "spread",
            Self::All => "all",
        }
    }

    /// Number of rows read for so many points and unknowns; twice the unknowns where it is free.
    pub fn count(self, points: usize, unknowns: usize) -> usize {
        match self {
            Self::MaxVol => unknowns,
            Self::Rectangular { count } | Self::Spread { count } => count.unwrap_or(points.min(2 * unknowns)),
            Self::All => points,
        }
    }
}

/// Options of a solver.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SolverOptions {
    /// Points read.
    pub handles: Handles,
    /// Treatment of the unstable end of the spectrum.
    pub regularizer: Regularizer,
    /// Spectrum threshold s: how many of the last singular directions are regularised.
    pub spectrum: usize,
    /// Weight λ of the regularisation beside the mean square error of the points; α for Tikhonov; 0
    /// is the same as a threshold of 0.
    pub lambda: f64,
}

/// Largest default number of regularised singular directions: the paper's threshold.
const DEFAULT_SPECTRUM: usize = 20;

impl SolverOptions {
    /// The paper's method (Thiery et al. 2012): handles of maximum volume and the cage's Laplacian.
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

/// Default threshold: min(20, m/16), so that coarse cages keep most of their freedom.
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
