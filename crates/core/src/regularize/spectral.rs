//! A term on the unstable end of the spectrum, and the baselines (paper §5.2).

use super::{Reference, Regularizer, WEAK_SINGULAR_VALUE};
use cager_geometry::linalg;
use cager_geometry::linalg::svd::LastDirections;
use faer::{Mat, MatRef};

/// Input of [`spectral_map`]: a decomposition and a regularisation term.
pub(crate) struct Spectrum<'a> {
    /// Singular values above the rank tolerance, descending, r ≤ m.
    pub(crate) sigma: &'a [f64],
    /// Right singular vectors, m × m; the last m − r span the null space.
    pub(crate) v: MatRef<'a, f64>,
    pub(crate) term: &'a RegularizationOperator,
}

/// A regularisation term for a cage.
pub(crate) struct RegularizationOperator {
    /// Δ, rows × m.
    pub(crate) delta: Mat<f64>,
    /// What `Δ C` should be.
    pub(crate) reference: Reference,
}

/// `q = data · x + target · C₀` for the coefficients `x = Uᵀ H` in the left singular vectors; of [`last_map`], for the cage x without a term.
pub(crate) struct SpectralMap {
    /// m × r.
    pub(crate) data: DataMap,
    /// m × m; `None` where the term has no reference or regularises no direction.
    pub(crate) target: Option<Mat<f64>>,
}

/// A linear map of coefficients.
pub(crate) enum DataMap {
    /// As a matrix.
    Matrix(Mat<f64>),
    /// The identity plus the product of two matrices, m × s and s × m.
    Update(Mat<f64>, Mat<f64>),
}

impl DataMap {
    /// As a matrix.
    pub(crate) fn matrix(&self) -> Mat<f64> {
        match self {
            Self::Matrix(map) => map.clone(),
            Self::Update(left, right) => {
                Mat::<f64>::identity(left.nrows(), left.nrows()) + linalg::product(left.as_ref(), right.as_ref())
            }
        }
    }
}

/// The map for a threshold s. `weight` multiplies the term beside a sum over all rows of A; for Tikhonov it is what is added to the
/// squared singular values. Directions outside the row space of A are always placed by Δ, except by the two baselines without a term; the
/// terms also place those with a singular value below [`WEAK_SINGULAR_VALUE`] of the largest.
///
/// `None` where a factorisation fails.
pub(crate) fn spectral_map(
    spectrum: &Spectrum<'_>,
    regularizer: Regularizer,
    s: usize,
    weight: f64,
) -> Option<SpectralMap> {
    let (m, r) = (spectrum.v.ncols(), spectrum.sigma.len());
    let null_dimension = m - r;
    let diagonal = |f: &dyn Fn(usize, f64) -> f64| {
        let data = Mat::from_fn(m, r, |i, j| if i == j { f(i, spectrum.sigma[i]) } else { 0.0 });
        SpectralMap { data: DataMap::Matrix(data), target: None }
    };
    match regularizer {
        Regularizer::TruncatedSvd => Some(diagonal(&|k, sigma| if k < m - s { 1.0 / sigma } else { 0.0 })),
        Regularizer::Tikhonov => Some(diagonal(&|_, sigma| sigma / (sigma * sigma + weight))),
        Regularizer::Global => sub_spectral(spectrum, m, weight),
        _ if regularizer.is_sub_spectral() => sub_spectral(spectrum, s.max(weak(spectrum)), weight),
        _ => sub_spectral(spectrum, null_dimension, 1.0),
    }
}

/// Number of directions that a term regularises whatever the threshold.
fn weak(spectrum: &Spectrum<'_>) -> usize {
    spectrum.v.ncols() - spectrum.sigma.iter().filter(|&&x| x >= WEAK_SINGULAR_VALUE * spectrum.sigma[0]).count()
}

/// Directions from m − s on minimise `w‖Δ V_high q_high + Δ V_low q_low − Δ C₀‖² + ‖Σ_high q_high − U_highᵀ H‖²`.
fn sub_spectral(spectrum: &Spectrum<'_>, s: usize, weight: f64) -> Option<SpectralMap> {
    let (m, r) = (spectrum.v.ncols(), spectrum.sigma.len());
    let low = m - s;
    let mut data = Mat::zeros(m, r);
    for k in 0..low {
        data[(k, k)] = 1.0 / spectrum.sigma[k];
    }
    if s == 0 {
        return Some(SpectralMap { data: DataMap::Matrix(data), target: None });
    }
    let delta_v = linalg::product(spectrum.term.delta.as_ref(), spectrum.v);
    let (delta_low, delta_high) = (delta_v.as_ref().subcols(0, low), delta_v.as_ref().subcols(low, s));
    let coupling = linalg::product(delta_high.transpose(), delta_low);
    let mut right = Mat::zeros(s, r);
    for i in 0..s {
        for k in 0..low {
            right[(i, k)] = -weight * coupling[(i, k)] / spectrum.sigma[k];
        }
        if low + i < r {
            right[(i, low + i)] = spectrum.sigma[low + i];
        }
    }
    let (high, target) = place(delta_high, &spectrum.sigma[low.min(r)..], right, spectrum.term, weight)?;
    for j in 0..r {
        for i in 0..s {
            data[(low + i, j)] = high[(i, j)];
        }
    }
    let target = target.map(|high| Mat::from_fn(m, m, |i, j| if i < low { 0.0 } else { high[(i - low, j)] }));
    Some(SpectralMap { data: DataMap::Matrix(data), target })
}

/// As [`spectral_map`] for a term that acts on the last s of the given directions, as a map from cages without a term to cages with it: the others'
/// part stays, and `U_highᵀ H` is `Σ_high V_highᵀ` times the cage.
///
/// `None` where a factorisation fails.
pub(crate) fn last_map(
    last: &LastDirections,
    term: &RegularizationOperator,
    s: usize,
    weight: f64,
) -> Option<SpectralMap> {
    let skipped = last.sigma.len() - s;
    let (sigma, v) = (&last.sigma[skipped..], last.v.as_ref().subcols(skipped, s));
    let mut update = Mat::zeros(s, v.nrows());
    let mut target = None;
    if s > 0 {
        let delta_high = linalg::product(term.delta.as_ref(), v);
        let seen = linalg::product(delta_high.transpose(), term.delta.as_ref());
        let mut right = linalg::product(linalg::product(seen.as_ref(), v).as_ref(), v.transpose());
        for (i, j) in (0..v.nrows()).flat_map(|j| (0..s).map(move |i| (i, j))) {
            right[(i, j)] = sigma[i] * sigma[i] * v[(j, i)] - weight * (seen[(i, j)] - right[(i, j)]);
        }
        let (high, of_reference) = place(delta_high.as_ref(), sigma, right, term, weight)?;
        update = high - v.transpose();
        target = of_reference.map(|high| linalg::product(v, high.as_ref()));
    }
    Some(SpectralMap { data: DataMap::Update(v.to_owned(), update), target })
}

/// Minimises `w‖Δ V_high q_high − …‖² + ‖Σ_high q_high − …‖²` for the right-hand sides of the data, s columns of normal equations each, and for that of
/// the reference, `w (Δ V_high)ᵀ Δ C₀`, where the term has one. `sigma` has fewer than s values where the last directions span the null space.
fn place(
    delta_high: MatRef<'_, f64>,
    sigma: &[f64],
    data: Mat<f64>,
    term: &RegularizationOperator,
    weight: f64,
) -> Option<(Mat<f64>, Option<Mat<f64>>)> {
    let (s, m, r) = (delta_high.ncols(), term.delta.ncols(), data.ncols());
    let mut system = linalg::product(delta_high.transpose(), delta_high);
    for (i, j) in (0..s).flat_map(|j| (0..s).map(move |i| (i, j))) {
        system[(i, j)] *= weight;
    }
    for (i, sigma) in sigma.iter().enumerate() {
        system[(i, i)] += sigma * sigma;
    }
    // Diagonal entry that rounding alone leaves for a direction in the null space of Δ.
    let rounding_level = weight * (1e-14 * term.delta.norm_l2()).powi(2);
    // The right-hand sides of the data, and after them those of the reference.
    let mut right = data;
    if term.reference != Reference::Origin {
        let target = linalg::product(delta_high.transpose(), term.delta.as_ref());
        right.resize_with(s, r + m, |i, j| weight * target[(i, j - r)]);
    }
    let solved = match linalg::solve_definite_within(system.clone(), right.clone(), 1e-13, rounding_level) {
        Some(solved) => solved,
        // Neither Δ nor any point determines the position of some connected component: add a small multiple of the identity, which keeps it near the
        // origin.
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
