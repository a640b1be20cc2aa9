//! A term on the unstable end of the spectrum, and the baselines (paper §5.2).

use super::decomposition::is_complete;
use crate::regularize::{Reference, Regularizer, WEAK_SINGULAR_VALUE};
use cager_geometry::linalg;
use cager_geometry::linalg::svd::LastDirections;
use faer::{Mat, MatRef};

/// The term `w ‖Δ C − Δ C₀‖²` beside a sum over all rows of A.
pub(super) struct Term {
    pub(super) regularizer: Regularizer,
    /// Δ, rows × m.
    pub(super) delta: Mat<f64>,
    /// How many of the last directions it acts on.
    pub(super) spectrum: usize,
    /// The weight w; for Tikhonov what is added to the squared singular values.
    pub(super) weight: f64,
}

/// `C = data · x + target · C₀` for the coefficients x of a `Decomposition`.
pub(super) struct SpectralMap {
    pub(super) data: Mat<f64>,
    /// m × m; `None` where the term has no reference or regularises no direction.
    pub(super) target: Option<Mat<f64>>,
}

/// The map of a term; `None` where a factorisation fails. Directions beyond the rank are always
/// placed by Δ, except by the two baselines without a term; terms also place weak ones.
pub(super) fn spectral_map(directions: &LastDirections, rank: usize, term: &Term) -> Option<SpectralMap> {
    let m = directions.v.nrows();
    let scaled = |factor: &dyn Fn(usize, f64) -> f64| {
        let data = Mat::from_fn(m, rank, |j, k| directions.v[(j, k)] * factor(k, directions.sigma[k]));
        SpectralMap { data, target: None }
    };
    let weight = term.weight;
    match term.regularizer {
        Regularizer::TruncatedSvd => Some(scaled(&|k, sigma| if k < m - term.spectrum { 1.0 / sigma } else { 0.0 })),
        Regularizer::Tikhonov => Some(scaled(&|_, sigma| sigma / (sigma * sigma + weight))),
        Regularizer::Global => sub_spectral(directions, rank, m, term),
        regularizer if regularizer.is_sub_spectral() => {
            let weak = directions.below(WEAK_SINGULAR_VALUE).max(m - rank);
            sub_spectral(directions, rank, term.spectrum.max(weak), term)
        }
        _ => sub_spectral(directions, rank, m - rank, &Term { delta: term.delta.clone(), weight: 1.0, ..*term }),
    }
}

/// The last s directions minimise `w‖Δ (C_low + V_high q) − Δ C₀‖² + ‖Σ_high q − U_highᵀ H‖²`.
fn sub_spectral(directions: &LastDirections, rank: usize, s: usize, term: &Term) -> Option<SpectralMap> {
    let LastDirections { sigma, v, .. } = directions;
    let m = v.nrows();
    let low = sigma.len() - s;
    let high = v.as_ref().subcols(low, s);
    let sigma_high = &sigma[low.min(rank)..if is_complete(directions) { rank } else { sigma.len() }];
    // C_low and Σ_high U_highᵀ H as functions of x.
    let (mut data, seen) = if is_complete(directions) {
        let data = Mat::from_fn(m, rank, |j, k| if k < low { v[(j, k)] / sigma[k] } else { 0.0 });
        let seen = Mat::from_fn(s, rank, |i, k| if k == low + i { sigma[k] } else { 0.0 });
        (data, seen)
    } else {
        let data = Mat::<f64>::identity(m, m) - linalg::product(high, high.transpose());
        (data, Mat::from_fn(s, m, |i, j| sigma_high[i] * sigma_high[i] * high[(j, i)]))
    };
    if s == 0 {
        return Some(SpectralMap { data, target: None });
    }
    let delta_high = linalg::product(term.delta.as_ref(), high);
    let coupling = linalg::product(delta_high.transpose(), term.delta.as_ref());
    let right = seen - faer::Scale(term.weight) * linalg::product(coupling.as_ref(), data.as_ref());
    let (placed, target) = place(delta_high.as_ref(), coupling.as_ref(), sigma_high, right, term)?;
    data += linalg::product(high, placed.as_ref());
    Some(SpectralMap { data, target: target.map(|target| linalg::product(high, target.as_ref())) })
}

/// Minimises `w‖Δ V_high q − …‖² + ‖Σ_high q − …‖²` for the right-hand sides of the data and for
/// that of the reference, `w (Δ V_high)ᵀ Δ C₀`. `sigma` is shorter beside a null space.
fn place(
    delta_high: MatRef<'_, f64>,
    coupling: MatRef<'_, f64>,
    sigma: &[f64],
    data: Mat<f64>,
    term: &Term,
) -> Option<(Mat<f64>, Option<Mat<f64>>)> {
    let (s, m, r) = (delta_high.ncols(), term.delta.ncols(), data.ncols());
    let mut system = faer::Scale(term.weight) * linalg::product(delta_high.transpose(), delta_high);
    for (i, sigma) in sigma.iter().enumerate() {
        system[(i, i)] += sigma * sigma;
    }
    // Diagonal entry that rounding alone leaves for a direction in the null space of Δ.
    let rounding_level = term.weight * (1e-14 * term.delta.norm_l2()).powi(2);
    // The right-hand sides of the data, and after them those of the reference.
    let mut right = data;
    if term.regularizer.reference() != Reference::Origin {
        right.resize_with(s, r + m, |i, j| term.weight * coupling[(i, j - r)]);
    }
    let solved = match linalg::solve_definite_within(system.clone(), right.clone(), 1e-13, rounding_level) {
        Some(solved) => solved,
        // Nothing determines where some connected component is: a small multiple of the identity
        // keeps it near the origin.
        None => {
            let size = (0..s).map(|i| system[(i, i)]).fold(0.0, f64::max);
            for i in 0..s {
                system[(i, i)] += if size > 0.0 { 1e-9 * size } else { 1.0 };
            }
            linalg::solve_definite(system, right)?
        }
    };
    let target = (solved.ncols() > r).then(|| solved.subcols(r, m).to_owned());
    Some((solved.subcols(0, r).to_owned(), target))
}
