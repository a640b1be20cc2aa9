//! The whole inversion as one matrix R, `C = R · H`.

use super::{BLOCK_ROWS, Handles, Preparation, PrepareError, SolverOptions};
use crate::dense;
use crate::regularize::{Spectrum, spectral_map};
use crate::simd::zeros;
use crate::spectrum::RowBasis;
use crate::svd::{self, Svd};
use faer::reborrow::Reborrow;
use faer::{Mat, MatRef, Par};
use rayon::prelude::*;

/// Decompositions of the handles and of all points.
pub(super) struct Spectra {
    pub(super) handles: Svd,
    pub(super) full_sigma: Vec<f64>,
    /// Of `R Φ□`, where every point is read.
    full: Option<Svd>,
}

impl Spectra {
    pub(super) fn of(basis: &RowBasis, read: Handles) -> Result<Self, PrepareError> {
        let (handles, full) = rayon::join(
            || svd::svd(basis.square.as_ref()),
            || {
                let compressed = basis.compressed()?;
                match read {
                    Handles::MaxVol => Some((svd::singular_values(compressed.as_ref())?, None)),
                    Handles::All => svd::svd(compressed.as_ref()).map(|svd| (svd.sigma.clone(), Some(svd))),
                }
            },
        );
        let failed = |what| PrepareError::NoSolution { what };
        let handles = handles.ok_or(failed("singular value decomposition of the handles"))?;
        let (full_sigma, full) = full.ok_or(failed("singular value decomposition of the coordinates"))?;
        Ok(Self { handles, full_sigma, full })
    }
}

/// The whole inversion as one matrix, transposed: r × m for handles of maximum volume, n × m for all points.
pub(super) fn operator(
    phi: MatRef<'_, f64>,
    basis: &RowBasis,
    spectra: Spectra,
    delta: MatRef<'_, f64>,
    options: SolverOptions,
    preparation: &mut Preparation,
) -> Result<Mat<f64>, PrepareError> {
    let failed = |what| PrepareError::NoSolution { what };
    let rank = basis.rank;
    // B carries the rounding of Φ□⁻¹, which least squares over all points feels beyond this condition.
    const GRAM_IS_SAFE: f64 = 1e6;
    let directly = options.handles == Handles::All && preparation.condition_full > GRAM_IS_SAFE;
    let decomposition = match (directly, spectra.full) {
        (true, _) => svd::svd(phi).ok_or(failed("singular value decomposition of the coordinates"))?,
        (false, Some(full)) => full,
        (false, None) => spectra.handles,
    };
    let Svd { u, sigma, v } = decomposition;
    let spectrum = Spectrum { sigma: &sigma[..rank], v: v.as_ref(), delta };
    let map = spectral_map(&spectrum, options.regularizer, options.spectrum, options.lambda)
        .ok_or(failed("regularised solve"))?;
    preparation.singular_values = sigma;
    let to_cage = dense::product(v.as_ref(), map.as_ref());
    let u = u.as_ref().subcols(0, rank);
    if directly {
        return Ok(tall_product(u, to_cage.transpose()));
    }
    let mut inverse = dense::product(u, to_cage.transpose());
    if options.handles == Handles::MaxVol {
        return Ok(inverse);
    }
    // Φ = B Φ□ and BᵀB = RᵀR: the left singular vectors of Φ are B R⁻¹ U.
    let factor = basis.gram_factor().ok_or(failed("factorisation of the handles"))?;
    faer::linalg::triangular_solve::solve_upper_triangular_in_place(factor.as_ref(), inverse.as_mut(), Par::Seq);
    let to_points = dense::product(basis.to_basis.as_ref(), inverse.as_ref());
    Ok(tall_product(phi, to_points.as_ref()))
}

/// Makes cages follow a translation of the frame exactly, also where regularisation by itself would not: the rows of R that
/// give positions sum to one, those that give directions to zero. Takes and gives `Rᵀ`.
pub(super) fn keep_translations(mut operator: Mat<f64>, positions: usize) -> Mat<f64> {
    let read = operator.nrows();
    for j in 0..operator.ncols() {
        let column = operator.col_mut(j);
        let sum: f64 = column.rb().iter().sum();
        let share = (if j < positions { 1.0 } else { 0.0 } - sum) / read as f64;
        for x in column.iter_mut() {
            *x += share;
        }
    }
    operator
}

/// Zero columns up to a whole tile, see [`product_columns`].
pub(super) fn with_whole_tiles(mut operator: Mat<f64>) -> Mat<f64> {
    operator.resize_with(operator.nrows(), operator.ncols().next_multiple_of(dense::WHOLE_ROWS), |_, _| 0.0);
    operator
}

/// `Φ · X` in parallel row blocks whose bits do not depend on the threads.
pub(crate) fn tall_product(phi: MatRef<'_, f64>, x: MatRef<'_, f64>) -> Mat<f64> {
    let mut out = zeros(phi.nrows(), x.ncols());
    out.as_mut().par_row_chunks_mut(BLOCK_ROWS).enumerate().for_each(|(block, rows)| {
        let count = rows.nrows();
        dense::multiply(rows, phi.subrows(block * BLOCK_ROWS, count), x);
    });
    out
}
