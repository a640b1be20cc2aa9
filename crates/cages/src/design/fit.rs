//! Least-squares cages of a sampled motion, and their residuals.

use cager_geometry::linalg::{
    accumulate_product, cholesky, gram, solve_cholesky, to_double, to_single, transposed_product,
};
use faer::{Accum, Mat, MatRef};

/// Rows of one parallel task: a quarter of a step's.
pub(super) const BLOCK_ROWS: usize = 550;

/// Least-squares cages of a motion, `min ‖X − Φ C‖² + ρ ‖C‖²`, by products in single precision.
pub(super) struct Fit {
    /// Cages `C`, m × c.
    pub(super) cages: Mat<f32>,
    /// Residual `X − Φ C`, n × c.
    pub(super) residual: Mat<f32>,
    /// Lower Cholesky factor of `ΦᵀΦ + ρ`, m × m.
    pub(super) factor: Mat<f64>,
}

impl Fit {
    /// Fits the motion X, n × c, with the ridge `ρ` over the mean diagonal entry of `ΦᵀΦ`.
    pub(super) fn new(phi: MatRef<'_, f32>, motion: MatRef<'_, f32>, ridge: f64) -> Option<Self> {
        Self::of_factor(phi, motion, || ridge_factor(to_double(gram(phi, BLOCK_ROWS).as_ref()), ridge))
    }

    /// As [`Self::new`], with a factor from elsewhere: in double precision for smaller ridges.
    pub(super) fn of_factor(
        phi: MatRef<'_, f32>,
        motion: MatRef<'_, f32>,
        factor: impl FnOnce() -> Option<Mat<f64>> + Send,
    ) -> Option<Self> {
        let product = || to_double(transposed_product(phi, motion, BLOCK_ROWS).as_ref());
        let (factor, mut cages) = rayon::join(factor, product);
        let factor = factor?;
        solve_cholesky(factor.as_ref(), &mut cages);
        let cages = to_single(cages.as_ref(), cages.nrows());
        let mut residual = motion.to_owned();
        accumulate_product(&mut residual, Accum::Add, phi, cages.as_ref(), -1.0);
        let finite = residual.as_ref().squared_norm_l2().is_finite();
        finite.then_some(Self { cages, residual, factor })
    }
}

/// Lower Cholesky factor of `G + ρ`, with `ρ` as a fraction of the mean diagonal entry of G.
pub(super) fn ridge_factor(mut gram: Mat<f64>, ridge: f64) -> Option<Mat<f64>> {
    let m = gram.nrows();
    let mean = (0..m).map(|j| gram[(j, j)]).sum::<f64>() / m as f64;
    for j in 0..m {
        gram[(j, j)] += ridge * mean;
    }
    cholesky(gram)
}
