//! Sub-spectral regularisation (Thiery, Tierny and Boubekeur 2012, §5) and its baselines.
//!
//! A term `λ‖Δ (C − C₀)‖²` is applied only to the directions with the smallest singular values.
//! With `A = U Σ Vᵀ` and `C = V q` every method is a matrix `T` in `q = T (Uᵀ H)`, to which a
//! reference cage adds a linear function of that cage.

mod laplacian;

pub(crate) use laplacian::cage_laplacian;

use crate::cage::Cage;
use cager_geometry::linalg::SparseMatrix;
use faer::{Mat, MatRef};

/// How the unstable end of the spectrum is treated.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Regularizer {
    /// Smooth the last s singular directions by the cage Laplacian: minimise `λ‖Δ C‖² + ‖Φ□ C −
    /// H‖²` over them, the others fixed by the data (Eq. 5–7). Penalises how vertices and unknown
    /// normals differ from the mean of their neighbours; destroys the rest cage's shape (§5.1).
    Laplacian,
    /// As the Laplacian, but keep the rest cage's shape: `λ‖Δ C − Δ C_R‖²`, so that sharp features
    /// survive (Savoye and Franco 2010). Parts rotated far from the rest pose shrink.
    #[default]
    Differential,
    /// As the Laplacian, but keep the shape of the previous frame's cage, `λ‖Δ C_t − Δ C_{t−1}‖²`,
    /// and of the rest cage at first, up to translations. Frames have to be inverted in order.
    Temporal,
    /// As the Laplacian, with a custom Δ: see [`SparseMatrix`].
    Matrix,
    /// No regularisation: the data term alone.
    None,
    /// Drop the last s singular directions.
    TruncatedSvd,
    /// Damp every direction: `σ/(σ² + α²)` in place of `1/σ`, with α = λ.
    Tikhonov,
    /// The Laplacian over the whole spectrum, as any other term does at the threshold s = m.
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

    /// Δ of its term for a cage with so many unknown rows: the given matrix for [`Self::Matrix`],
    /// otherwise the cage Laplacian. [`Self::None`] applies it only to directions that no point
    /// determines; [`Self::TruncatedSvd`] and [`Self::Tikhonov`] do not use it.
    pub fn delta(self, matrix: Option<&SparseMatrix>, cage: &Cage, unknowns: usize) -> Result<Mat<f64>, TermError> {
        match self {
            Self::Matrix => {
                let (matrix, vertices) = (matrix.ok_or(TermError::Missing)?, cage.vertices().len());
                // A matrix with one column per vertex does not affect unknown normals.
                if ![unknowns, vertices].contains(&matrix.columns()) {
                    return Err(TermError::Columns { columns: matrix.columns(), vertices, unknowns });
                }
                Ok(matrix.compressed(unknowns))
            }
            _ => Ok(cage_laplacian(cage, unknowns)),
        }
    }

    /// The cage `C₀` of its term.
    pub fn reference(self) -> Reference {
        match self {
            Self::Differential => Reference::RestCage,
            Self::Temporal => Reference::PreviousCage,
            _ => Reference::Origin,
        }
    }
}

/// The cage `C₀` in `λ‖Δ C − Δ C₀‖²`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reference {
    /// Zero: `Δ C` itself is penalised.
    Origin,
    /// The rest pose's; adds a constant to every cage.
    RestCage,
    /// The previous frame's, and the rest pose's for the first frame.
    PreviousCage,
}

/// Why a term cannot be used with a cage.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum TermError {
    /// The columns of a matrix are not the cage's unknowns.
    #[error("the regularisation matrix has {columns} columns, but the cage has {}; give one column per unknown, in its order", expected(*.vertices, *.unknowns))]
    Columns {
        /// Columns of the matrix.
        columns: usize,
        /// Vertices of the cage v.
        vertices: usize,
        /// Unknowns m.
        unknowns: usize,
    },
    /// None was given.
    #[error("the regularizer matrix needs a matrix; give one")]
    Missing,
}

fn expected(vertices: usize, unknowns: usize) -> String {
    if vertices == unknowns {
        return format!("{vertices} vertices");
    }
    format!("{vertices} vertices, or {unknowns} unknowns with the normals of its faces")
}

/// Directions below this fraction of the largest singular value amplify rounding beyond use.
pub const WEAK_SINGULAR_VALUE: f64 = 1e-6;

/// Adds `weight · ΔᵀΔ`, for a Δ of few entries in each row.
pub(crate) fn add_term(system: &mut Mat<f64>, delta: MatRef<'_, f64>, weight: f64) {
    for row in delta.row_iter() {
        let entries: Vec<(usize, f64)> = row.iter().copied().enumerate().filter(|&(_, x)| x != 0.0).collect();
        for &(a, x) in &entries {
            entries.iter().for_each(|&(b, y)| system[(b, a)] += weight * x * y);
        }
    }
}
