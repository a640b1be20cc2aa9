//! Least squares over all points, regularised over the whole spectrum, by its normal equations:
//! `(ΦᵀΦ + w ΔᵀΔ) C = Φᵀ P + w ΔᵀΔ C₀` with `w = λ n/m`: λ is beside the mean square error.

use super::{
    AnalysedCoordinates, Handles, Nearness, PreparationReport, PrepareContext, PrepareError, RegularizationTarget,
    Solver, SolverOptions, Step, about_first, failed, with_unit_row_sums,
};
use crate::batch::padded_to_tiles;
use crate::cage::Cage;
use crate::decode::Decoder;
use crate::regularize::{Reference, Regularizer, WEAK_SINGULAR_VALUE, add_term};
use cager_geometry::linalg::{self, svd};
use faer::{Mat, MatRef};

/// Pivots below this fraction of their diagonal entries leave too few digits.
const SMALLEST_PIVOT: f64 = 1e-10;

/// Whether the options ask for all points and a term over the whole spectrum.
pub(super) fn applies(options: SolverOptions, unknowns: usize) -> bool {
    let is_complete = options.regularizer == Regularizer::Global
        || options.regularizer.is_sub_spectral() && options.spectrum == unknowns;
    options.handles == Handles::All && is_complete && options.lambda > 0.0
}

/// The solver of such options; the coordinates where the equations are too ill-conditioned.
pub(super) fn solver(
    found: AnalysedCoordinates,
    cage: &Cage,
    delta: MatRef<'_, f64>,
    options: SolverOptions,
    context: &PrepareContext<'_>,
) -> Result<Result<Solver, AnalysedCoordinates>, PrepareError> {
    context.begin(Step::Operator)?;
    let phi = found.phi.as_ref();
    let (n, m) = phi.shape();
    let positions = cage.vertices().len();
    let weight = options.lambda * n as f64 / m as f64;
    let gram = linalg::lower_product(phi.transpose(), phi);
    let mut system = gram.clone();
    add_term(&mut system, delta, weight);
    // The inverse, the target of the rest cage, and what a translation of that would add to it.
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
    let (operator, determined) = rayon::join(operator, || Determined::of(gram));
    let Determined { factor, rank, condition, weak } = determined.ok_or(failed("factorisation of the coordinates"))?;
    let factor = faer::Scale((m as f64 / n as f64).sqrt()) * factor;
    let nearness =
        options.regularizer.is_sub_spectral().then(|| Nearness::new(factor, &found.rest, cage, &found.points));
    let AnalysedCoordinates { phi, sample, decoder, diagonal, preparation, .. } = found;
    let (condition_full, condition_handles) = (condition, condition);
    let preparation = PreparationReport { rank, condition_full, condition_handles, weak, ..preparation };
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
struct Determined {
    /// F with `FᵀF = ΦᵀΦ`, one row for each of the rank.
    factor: Mat<f64>,
    /// Numerical rank of `ΦᵀΦ`.
    rank: usize,
    /// Condition number of `Φ` over the rank.
    condition: f64,
    /// Directions of which the points say next to nothing.
    weak: usize,
}

impl Determined {
    /// From the pivots of `ΦᵀΦ`. `None` where it is not finite.
    fn of(gram: Mat<f64>) -> Option<Self> {
        let m = gram.nrows();
        let (lower, order) = linalg::pivoted_cholesky(gram)?;
        let rank = lower.ncols();
        let first = lower.submatrix(0, 0, rank, rank).transpose().to_owned();
        let inverse = linalg::upper_inverse(first.as_ref());
        let [largest, smallest] = svd::ends(first.as_ref(), inverse.as_ref());
        let strong = (0..rank).filter(|&k| lower[(k, k)] >= WEAK_SINGULAR_VALUE * lower[(0, 0)]).count();
        let mut factor = Mat::zeros(rank, m);
        for (i, &column) in order.iter().enumerate() {
            factor.col_mut(column).copy_from(lower.row(i).transpose());
        }
        Some(Self { factor, rank, condition: largest / smallest, weak: m - strong })
    }
}
