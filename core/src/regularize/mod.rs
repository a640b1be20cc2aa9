//! Sub-spectral regularisation (Thiery, Tierny and Boubekeur 2012, §5) and the baselines it is compared with.
//!
//! All of them act on the singular directions of the inverted matrix: with `A = U Σ Vᵀ` and `C = V q` they are a matrix `T`
//! in `q = T (Uᵀ H)`.

mod laplacian;

pub(crate) use laplacian::cage_laplacian;

use crate::dense;
use faer::{Mat, MatRef};

/// How the unstable end of the spectrum is treated.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Regularizer {
    /// Smooth the last s singular directions by the cage Laplacian: minimise `λ‖Δ C‖² + ‖Φ□ C − H‖²` over them, the others
    /// fixed by the data (Eq. 5–7).
    #[default]
    Laplacian,
    /// Plain inversion: the data alone.
    None,
    /// Drop the last s singular directions.
    TruncatedSvd,
    /// Damp every direction: `σ/(σ² + α²)` in place of `1/σ`, with α = λ.
    Tikhonov,
    /// The Laplacian over the whole spectrum: the classical regularised least squares.
    Global,
}

impl Regularizer {
    /// All, in the order of the documentation.
    pub const ALL: [Self; 5] = [Self::Laplacian, Self::None, Self::TruncatedSvd, Self::Tikhonov, Self::Global];

    /// The name on the command line, in reports and in containers.
    pub fn name(self) -> &'static str {
        match self {
            Self::Laplacian => "laplacian",
            Self::None => "none",
            Self::TruncatedSvd => "truncated-svd",
            Self::Tikhonov => "tikhonov",
            Self::Global => "global",
        }
    }
}

/// What [`spectral_map`] needs to know of the decomposition.
pub(crate) struct Spectrum<'a> {
    /// Singular values above the rank tolerance, descending, r ≤ m.
    pub(crate) sigma: &'a [f64],
    /// Right singular vectors, m × m; the last m − r span the null space.
    pub(crate) v: MatRef<'a, f64>,
    /// Regularisation term Δ, rows × m.
    pub(crate) delta: MatRef<'a, f64>,
}

/// Directions with a singular value below this fraction of the largest amplify single-precision cages beyond use.
pub const WEAK: f64 = 1e-6;

/// `T`, m × r. Directions the data says nothing about are always placed by Δ, but for the two baselines that have no term;
/// with the Laplacian, those it says next to nothing about as well.
///
/// `None` where a factorisation fails.
pub(crate) fn spectral_map(
    spectrum: &Spectrum<'_>,
    regularizer: Regularizer,
    s: usize,
    lambda: f64,
) -> Option<Mat<f64>> {
    let (m, r) = (spectrum.v.ncols(), spectrum.sigma.len());
    let dead = m - r;
    let diagonal =
        |f: &dyn Fn(usize, f64) -> f64| Mat::from_fn(m, r, |i, j| if i == j { f(i, spectrum.sigma[i]) } else { 0.0 });
    match regularizer {
        Regularizer::TruncatedSvd => Some(diagonal(&|k, sigma| if k < m - s { 1.0 / sigma } else { 0.0 })),
        Regularizer::Tikhonov => Some(diagonal(&|_, sigma| sigma / (sigma * sigma + lambda * lambda))),
        Regularizer::Global => sub_spectral(spectrum, m, lambda),
        Regularizer::Laplacian if lambda > 0.0 => {
            let strong = spectrum.sigma.iter().filter(|&&x| x >= WEAK * spectrum.sigma[0]).count();
            sub_spectral(spectrum, s.max(m - strong), lambda)
        }
        Regularizer::Laplacian | Regularizer::None => sub_spectral(spectrum, dead, 1.0),
    }
}

/// Directions from m − s on minimise `λ‖Δ V_high q_high + Δ V_low q_low‖² + ‖Σ_high q_high − U_highᵀ H‖²`.
fn sub_spectral(spectrum: &Spectrum<'_>, s: usize, lambda: f64) -> Option<Mat<f64>> {
    let (m, r) = (spectrum.v.ncols(), spectrum.sigma.len());
    let low = m - s;
    let mut map = Mat::zeros(m, r);
    for k in 0..low {
        map[(k, k)] = 1.0 / spectrum.sigma[k];
    }
    if s == 0 {
        return Some(map);
    }
    let bent = dense::product(spectrum.delta, spectrum.v);
    let (bent_low, bent_high) = (bent.as_ref().subcols(0, low), bent.as_ref().subcols(low, s));
    let mut system = dense::product(bent_high.transpose(), bent_high);
    let coupling = dense::product(bent_high.transpose(), bent_low);
    let mut right = Mat::zeros(s, r);
    for i in 0..s {
        for j in 0..s {
            system[(i, j)] *= lambda;
        }
        for k in 0..low {
            right[(i, k)] = -lambda * coupling[(i, k)] / spectrum.sigma[k];
        }
        if low + i < r {
            let sigma = spectrum.sigma[low + i];
            system[(i, i)] += sigma * sigma;
            right[(i, low + i)] = sigma;
        }
    }
    let high = match dense::solve_definite(system.clone(), right.clone()) {
        Some(high) => high,
        // Δ leaves the place of a whole shell free, and no point feels that shell: hold it near the centre.
        None => {
            let size = (0..s).map(|i| system[(i, i)]).fold(0.0, f64::max);
            for i in 0..s {
                system[(i, i)] += if size > 0.0 { 1e-9 * size } else { 1.0 };
            }
            dense::solve_definite(system, right)?
        }
    };
    for j in 0..r {
        for i in 0..s {
            map[(low + i, j)] = high[(i, j)];
        }
    }
    Some(map)
}
