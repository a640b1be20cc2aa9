//! A triangular factor of `ΦᵀΦ`, its condition number and rank.

use cager_geometry::linalg;
use cager_geometry::linalg::svd::{self, LastDirections};
use faer::{Mat, MatRef};

/// Singular values below this fraction of the largest are zero: coordinates are not more accurate.
pub(crate) const RANK_TOLERANCE: f64 = 1e-11;

/// Condition number of `Φ` up to which the Cholesky factor of `ΦᵀΦ` keeps ten of sixteen digits.
const CHOLESKY_IS_SAFE: f64 = 1e5;

/// Upper triangular R with `ΦᵀΦ = RᵀR`, which has the singular values and right vectors of `Φ`.
pub(crate) struct NormalFactor {
    factor: Mat<f64>,
    /// The inverse of R and its ends of the spectrum; `None` where `Φ` is ill-conditioned.
    conditioned: Option<(Mat<f64>, [f64; 2])>,
}

impl NormalFactor {
    /// Of `Φ`, n × m with n ≥ m.
    pub(crate) fn of(phi: MatRef<'_, f64>) -> Self {
        if let Some(factor) = linalg::cholesky(linalg::lower_product(phi.transpose(), phi)) {
            let factor = factor.transpose().to_owned();
            let inverse = linalg::upper_inverse(factor.as_ref());
            let [first, last] = svd::ends(factor.as_ref(), inverse.as_ref());
            if first <= CHOLESKY_IS_SAFE * last {
                return Self { factor, conditioned: Some((inverse, [first, last])) };
            }
        }
        Self { factor: linalg::upper_factor(phi.to_owned()), conditioned: None }
    }

    /// R, m × m.
    pub(crate) fn matrix(&self) -> MatRef<'_, f64> {
        self.factor.as_ref()
    }

    /// `F` with `FᵀF = s² ΦᵀΦ`.
    pub(crate) fn scaled(&self, s: f64) -> Mat<f64> {
        faer::Scale(s) * &self.factor
    }

    /// `(ΦᵀΦ)⁻¹`; `None` where `Φ` is ill-conditioned.
    pub(crate) fn normal_inverse(&self) -> Option<Mat<f64>> {
        let (inverse, _) = self.conditioned.as_ref()?;
        Some(linalg::product(inverse.as_ref(), inverse.transpose()))
    }

    /// The last singular directions; `None` where `Φ` is ill-conditioned, or they do not converge.
    pub(crate) fn last_directions(&self, count: usize) -> Option<LastDirections> {
        let (inverse, [first, _]) = self.conditioned.as_ref()?;
        svd::last_directions(inverse.as_ref(), *first, count)
    }

    /// Numerical rank and the condition number over it, from all singular values if known.
    pub(crate) fn rank_and_condition(&self, known: Option<&[f64]>) -> Option<(usize, f64)> {
        if let Some((_, [first, last])) = &self.conditioned {
            return Some((self.factor.ncols(), first / last));
        }
        let computed;
        let sigma = match known {
            Some(known) => known,
            None => {
                computed = svd::singular_values(self.matrix())?;
                &computed
            }
        };
        let rank = sigma.iter().filter(|&&s| s > RANK_TOLERANCE * sigma[0]).count();
        Some((rank, sigma[0] / *sigma.get(rank.checked_sub(1)?)?))
    }
}
