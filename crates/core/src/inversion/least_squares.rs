//! Least squares over all points, regularised over the whole spectrum, by its normal equations:
//! `(ΦᵀΦ + w ΔᵀΔ) C = Φᵀ P + w ΔᵀΔ C₀` with `w = λ n/m`, so that λ is relative to the mean square error of the points.

use super::analysed_coordinates::AnalysisCoordinates;
use super::checks::about_first;
use super::nearness::Nearness;
use super::operator::padded_to_tiles;
use super::translations::with_unit_row_sums;
use super::{PreparationReport, PrepareContext, PrepareError, RegularizationTarget, Solver, SolverOptions, Step};
use crate::cage::Cage;
use crate::decode::Decoder;
use crate::handles::Handles;
use crate::maxvol::RANK_TOLERANCE;
use crate::regularize::{Reference, Regularizer, add_term};
use cager_geometry::linalg::{self, svd};
use faer::{Mat, MatRef};

/// Pivots of the normal equations below this fraction of their diagonal entries leave too few digits: singular directions solve such systems.
const SMALLEST_PIVOT: f64 = 1e-10;

/// Condition number of `Φ` up to which the Cholesky factor of `ΦᵀΦ` keeps its smallest singular values to four digits.
const FACTOR_IS_SAFE: f64 = 1e6;

/// Whether the options ask for all points and a term over the whole spectrum.
pub(super) fn applies(options: SolverOptions, unknowns: usize) -> bool {
    let is_complete = options.regularizer == Regularizer::Global
        || options.regularizer.is_sub_spectral() && options.spectrum == unknowns;
    options.handles == Handles::All && is_complete && options.lambda > 0.0
}

/// The solver of such options; gives the coordinates back where the normal equations are too ill-conditioned.
///
/// # Errors
/// [`PrepareError::Stopped`], and where a decomposition does not converge.
pub(super) fn solver(
    found: AnalysisCoordinates,
    cage: &Cage,
    delta: MatRef<'_, f64>,
    options: SolverOptions,
    context: &PrepareContext<'_>,
) -> Result<Result<Solver, AnalysisCoordinates>, PrepareError> {
    context.begin(Step::Operator)?;
    let phi = found.phi.as_ref();
    let (n, m) = phi.shape();
    let positions = cage.vertices().len();
    let weight = options.lambda * n as f64 / m as f64;
    let normal = linalg::mirrored(linalg::lower_product(phi.transpose(), phi));
    let mut system = normal.clone();
    add_term(&mut system, delta, weight);
    // The inverse, the target of the rest cage, and what a translation of that cage would add to it.
    let reference = options.regularizer.reference();
    let mut right = Mat::<f64>::identity(m, m);
    let mut term = Mat::<f64>::zeros(m, m);
    if reference != Reference::Origin {
        add_term(&mut term, delta, weight);
    }
    if reference == Reference::RestCage {
        let rest = about_first(&found.rest, positions);
        let moved = Mat::from_fn(m, 4, |i, k| if k < 3 { rest[(i, k)] } else { f64::from(u8::from(i < positions)) });
        let moved = linalg::product(term.as_ref(), moved.as_ref());
        right.resize_with(m, m + 4, |i, j| moved[(i, j - m)]);
    }
    let Some(solved) = linalg::solve_definite_within(system, right, SMALLEST_PIVOT, 0.0) else {
        return Ok(Err(found));
    };
    let inverse = solved.as_ref().subcols(0, m);
    let target = match reference {
        Reference::Origin => RegularizationTarget::None,
        Reference::RestCage => {
            let rest = about_first(&found.rest, positions);
            let mean = |k: usize| (0..positions).map(|i| rest[(i, k)]).sum::<f64>() / positions as f64;
            let mean = [0, 1, 2].map(mean);
            RegularizationTarget::Constant(Mat::from_fn(m, 3, |i, k| solved[(i, m + k)] - solved[(i, m + 3)] * mean[k]))
        }
        Reference::PreviousCage => {
            RegularizationTarget::towards_previous(linalg::product(inverse, term.as_ref()), &found.rest, positions)
        }
    };
    let operator = || padded_to_tiles(with_unit_row_sums(linalg::tall_product(phi, inverse), positions));
    let conditioned = || conditioning(phi, normal);
    let (operator, spectrum) = rayon::join(operator, conditioned);
    let Conditioning { factor, rank, condition, singular_values } =
        spectrum.ok_or(super::error::failed("singular value decomposition of the coordinates"))?;
    let scale = (m as f64 / n as f64).sqrt();
    let factor = faer::Scale(scale) * factor;
    let nearness =
        options.regularizer.is_sub_spectral().then(|| Nearness::new(factor, &found.rest, cage, &found.points));
    let AnalysisCoordinates { phi, sample, decoder, diagonal, preparation, .. } = found;
    let (condition_full, condition_handles) = (condition, condition);
    let preparation = PreparationReport { rank, condition_full, condition_handles, singular_values, ..preparation };
    Ok(Ok(Solver {
        reads_all: sample.is_none(),
        handles: sample.unwrap_or_default(),
        operator,
        target,
        consistent: None,
        nearness: nearness.flatten().map(Into::into),
        decoder: decoder.unwrap_or_else(|| Decoder::new(phi.as_ref(), positions)),
        diagonal,
        preparation,
    }))
}

/// What the points determine of a cage.
struct Conditioning {
    /// Upper triangular R with `ΦᵀΦ = RᵀR`.
    factor: Mat<f64>,
    /// Numerical rank of `Φ`.
    rank: usize,
    /// Condition number over the rank.
    condition: f64,
    /// All singular values, descending, where it took them to find out.
    singular_values: Vec<f64>,
}

/// From the Cholesky factor of `ΦᵀΦ`, and of an ill-conditioned `Φ` from its QR factorisation. `None` where that does not converge.
fn conditioning(phi: MatRef<'_, f64>, normal: Mat<f64>) -> Option<Conditioning> {
    let m = phi.ncols();
    if let Some(factor) = linalg::cholesky(normal) {
        let factor = factor.transpose().to_owned();
        let inverse = linalg::upper_inverse(factor.as_ref());
        let [first, last] = svd::ends(None, factor.as_ref(), inverse.as_ref());
        let condition = first / last;
        if condition <= FACTOR_IS_SAFE {
            return Some(Conditioning { factor, rank: m, condition, singular_values: Vec::new() });
        }
    }
    let factor = linalg::upper_factor(phi.to_owned());
    let singular_values = svd::singular_values(factor.as_ref())?;
    let rank = singular_values.iter().filter(|&&s| s > RANK_TOLERANCE * singular_values[0]).count();
    let condition = singular_values[0] / *singular_values.get(rank.checked_sub(1)?)?;
    Some(Conditioning { factor, rank, condition, singular_values })
}
