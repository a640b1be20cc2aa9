//! Sub-spectral regularisation (Thiery, Tierny and Boubekeur 2012, §5) and the baselines it is compared with.
//!
//! A [`Term`] is a quadratic penalty on the cage, applied only to the singular directions with the smallest singular values. With `A = U Σ Vᵀ`
//! and `C = V q` every method here is a matrix `T` in `q = T (Uᵀ H)`, to which a term with a reference cage adds a linear function of that cage.

mod differential;
mod laplacian;
mod matrix;
mod spectral;
mod temporal;
mod term;

pub use differential::Differential;
pub use laplacian::CageLaplacian;
pub use matrix::SparseMatrix;
pub use temporal::Temporal;
pub use term::{Reference, Term, TermError};

pub(crate) use laplacian::cage_laplacian;
pub(crate) use spectral::{DataMap, RegularizationOperator, SpectralMap, Spectrum, last_map, spectral_map};

/// How the unstable end of the spectrum is treated.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Regularizer {
    /// Smooth the last s singular directions by the cage Laplacian: minimise `λ‖Δ C‖² + ‖Φ□ C − H‖²` over them, the others
    /// fixed by the data (Eq. 5–7). See [`CageLaplacian`].
    Laplacian,
    /// As the Laplacian, but keep the rest cage's shape: `λ‖Δ C − Δ C_R‖²`, so that a frame that equals the rest pose gives the rest
    /// cage. See [`Differential`].
    #[default]
    Differential,
    /// As the Laplacian, but keep the shape of the previous frame's cage: `λ‖Δ C_t − Δ C_{t−1}‖²`. Makes every frame depend on
    /// the ones before it. See [`Temporal`].
    Temporal,
    /// As the Laplacian, with a custom Δ: see [`SparseMatrix`].
    Matrix,
    /// No regularisation: the data term alone.
    None,
    /// Drop the last s singular directions.
    TruncatedSvd,
    /// Damp every direction: `σ/(σ² + α²)` in place of `1/σ`, with α = λ.
    Tikhonov,
    /// The Laplacian over the whole spectrum: the classical regularised least squares. Any other term does the same at the
    /// threshold s = m.
    Global,
}

impl Regularizer {
    /// All, in the order of the documentation.
    pub const ALL: [Self; 8] = [
        Self::Laplacian,
        Self::Differential,
        Self::Temporal,
        Self::Matrix,
        Self::None,
        Self::TruncatedSvd,
        Self::Tikhonov,
        Self::Global,
    ];

    /// The name on the command line, in reports and in containers.
    pub fn name(self) -> &'static str {
        match self {
            Self::Laplacian => "laplacian",
            Self::Differential => "differential",
            Self::Temporal => "temporal",
            Self::Matrix => "matrix",
            Self::None => "none",
            Self::TruncatedSvd => "truncated-svd",
            Self::Tikhonov => "tikhonov",
            Self::Global => "global",
        }
    }

    /// The one with this name.
    pub fn by_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|regularizer| regularizer.name() == name)
    }

    /// Whether the threshold s makes a difference.
    pub fn has_threshold(self) -> bool {
        !matches!(self, Self::None | Self::Tikhonov | Self::Global)
    }

    /// Whether a term acts on the last s singular directions alone.
    pub fn is_sub_spectral(self) -> bool {
        matches!(self, Self::Laplacian | Self::Differential | Self::Temporal | Self::Matrix)
    }

    /// Its term; `None` where it is custom. [`Self::None`] applies the Laplacian only to directions that no point determines;
    /// [`Self::TruncatedSvd`] and [`Self::Tikhonov`] do not use it.
    pub fn term(self) -> Option<&'static dyn Term> {
        match self {
            Self::Matrix => None,
            Self::Differential => Some(&Differential),
            Self::Temporal => Some(&Temporal),
            Self::Laplacian | Self::None | Self::TruncatedSvd | Self::Tikhonov | Self::Global => Some(&CageLaplacian),
        }
    }
}

/// Directions with a singular value below this fraction of the largest amplify single-precision cages beyond use.
pub const WEAK_SINGULAR_VALUE: f64 = 1e-6;
