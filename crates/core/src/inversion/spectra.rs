//! The decompositions that an analysis computes, and which of them its solvers need.

use super::error::failed;
use super::{PrepareError, SolverOptions};
use crate::handles::Handles;
use crate::regularize::{Regularizer, WEAK_SINGULAR_VALUE};
use crate::row_basis::RowBasis;
use cager_geometry::linalg;
use cager_geometry::linalg::svd::{self, LastDirections, Svd};
use faer::{Mat, MatRef};

/// Which decompositions to compute.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum RequiredDecompositions {
    /// All of them.
    Everything,
    /// What solvers that read these handles need, whatever their regularisation.
    For(Handles),
    /// What solvers that read these handles need where a term acts on the last s singular directions at the most.
    Last(Handles, usize),
}

impl RequiredDecompositions {
    /// What one solver needs.
    pub(super) fn of_solver(options: SolverOptions) -> Self {
        let acts_on_last = options.regularizer == Regularizer::None || options.regularizer.is_sub_spectral();
        if acts_on_last { Self::Last(options.handles, options.spectrum) } else { Self::For(options.handles) }
    }

    /// The handles, if they are chosen.
    pub(super) fn handles(self) -> Option<Handles> {
        match self {
            Self::Everything => None,
            Self::For(handles) | Self::Last(handles, _) => Some(handles),
        }
    }

    /// The number of directions that a term acts on, where a full decomposition takes longer than their own.
    fn last(self, unknowns: usize) -> Option<usize> {
        match self {
            Self::Last(Handles::Rectangular { .. }, _) => None,
            Self::Last(_, count) if unknowns >= PARTIAL_SVD_FROM && count <= unknowns / MIN_UNKNOWNS_PER_DIRECTION => {
                Some(count.max(1))
            }
            _ => None,
        }
    }
}

/// From this many unknowns on, only the largest and smallest singular values are computed where no more of a decomposition is needed.
pub(super) const EXTREMES_ONLY_FROM: usize = 512;
/// From this many unknowns on, only the directions that a term acts on are computed.
const PARTIAL_SVD_FROM: usize = 1024;
/// They are found on their own only where there are at least this many unknowns for each.
const MIN_UNKNOWNS_PER_DIRECTION: usize = 32;

/// Condition number of `Φ` up to which its normal equations keep ten of sixteen digits, or, of the direction that the points determine least, six.
const NORMAL_IS_SAFE: f64 = 1e5;

/// Decompositions of the handles of maximum volume and of all points.
#[derive(Clone)]
pub(super) struct Spectra {
    /// Of `Φ□`; none where at most its extreme singular values are needed.
    pub(super) handles: Option<Svd>,
    /// Largest and smallest singular value of `Φ□` over the rank, where they are needed.
    pub(super) handles_ends: Option<[f64; 2]>,
    /// Singular values of `Φ`; none where only the ends are known.
    pub(super) full_sigma: Vec<f64>,
    /// The largest of them, the smallest over the rank, and the last of all.
    pub(super) full_ends: [f64; 3],
    /// R from [`RowBasis::gram_factor`], except where the normal equations take its place.
    pub(super) gram_factor: Option<Mat<f64>>,
    /// Of `R Φ□`; only where least squares sums over all points.
    pub(super) full: Option<Svd>,
    /// The last directions of what is inverted, `Φ□` or `Φ`, in place of its whole decomposition.
    pub(super) last: Option<LastDirections>,
    /// Upper triangular R with `ΦᵀΦ = RᵀR`, where the last directions are those of `Φ`.
    pub(super) normal_factor: Option<Mat<f64>>,
}

impl Spectra {
    pub(super) fn of(
        phi: MatRef<'_, f64>,
        basis: &RowBasis,
        required: RequiredDecompositions,
    ) -> Result<Self, PrepareError> {
        let m = basis.square.ncols();
        let (rank, large) = (basis.rank, m >= EXTREMES_ONLY_FROM && basis.rank == m);
        let no_spectrum = failed("singular value decomposition of the coordinates");
        let whole_frames = matches!(required.handles(), None | Some(Handles::All | Handles::Spread { .. }));
        let inverse = basis.handles.inverse.as_ref();
        let count_of_last = required.last(m).filter(|_| large);
        let normal = count_of_last.and_then(|_| Normal::of(phi));
        let last = match count_of_last {
            Some(count) if whole_frames => normal.as_ref().and_then(|normal| normal.last_directions(count)),
            Some(count) => enough(svd::last_directions(inverse, svd::first_value(&[basis.square.as_ref()]), count)),
            None => None,
        };
        let ends_of_all = match &last {
            Some(last) if whole_frames => Some(last.ends()),
            Some(_) => normal.as_ref().and_then(Normal::ends),
            None => None,
        };
        let gram_factor = if ends_of_all.is_some() { None } else { basis.gram_factor(phi) };
        let vectors_of_handles = match required.handles() {
            None | Some(Handles::MaxVol) => last.is_none(),
            Some(Handles::All) => !large,
            Some(Handles::Spread { .. } | Handles::Rectangular { .. }) => false,
        };
        let values_of_all = !large || required == RequiredDecompositions::Everything;
        let vectors_of_all = whole_frames && last.is_none();
        let whole = || {
            if !vectors_of_all && !values_of_all {
                return Some((Vec::new(), None));
            }
            let factor = gram_factor.as_ref()?;
            let compressed = linalg::product(factor.as_ref(), basis.square.as_ref());
            if vectors_of_all {
                svd::svd(compressed.as_ref()).map(|svd| (svd.sigma.clone(), Some(svd)))
            } else {
                Some((svd::singular_values(compressed.as_ref())?, None))
            }
        };
        let (handles, full) = rayon::join(|| vectors_of_handles.then(|| svd::svd(basis.square.as_ref())), whole);
        let handles = match handles {
            Some(None) => return Err(failed("singular value decomposition of the handles")),
            Some(Some(svd)) => Some(svd),
            None => None,
        };
        let (full_sigma, full) = full.ok_or(no_spectrum.clone())?;
        let full_ends = match (full_sigma.last(), ends_of_all) {
            (Some(&last), _) => [full_sigma[0], full_sigma[rank - 1], last],
            (None, Some([first, last])) => [first, last, last],
            _ => {
                let factor = gram_factor.as_ref().ok_or(no_spectrum)?;
                let [first, last] = svd::ends(Some(factor.as_ref()), basis.square.as_ref(), inverse);
                [first, last, last]
            }
        };
        let handles_ends = match (&handles, required.handles()) {
            (Some(svd), _) => Some([svd.sigma[0], svd.sigma[rank - 1]]),
            (None, Some(Handles::MaxVol)) => last.as_ref().map(LastDirections::ends),
            (None, Some(Handles::All)) => Some(svd::ends(None, basis.square.as_ref(), inverse)),
            (None, _) => None,
        };
        let normal_factor = normal.filter(|_| whole_frames && last.is_some()).map(|normal| normal.factor);
        Ok(Self { handles, handles_ends, full_sigma, full_ends, gram_factor, full, last, normal_factor })
    }
}

/// The normal equations of `Φ`.
struct Normal {
    /// Upper triangular R with `ΦᵀΦ = RᵀR`, which has the singular values and right vectors of `Φ`.
    factor: Mat<f64>,
    inverse: Mat<f64>,
}

impl Normal {
    fn of(phi: MatRef<'_, f64>) -> Option<Self> {
        let factor = linalg::cholesky(linalg::lower_product(phi.transpose(), phi))?.transpose().to_owned();
        let inverse = linalg::upper_inverse(factor.as_ref());
        Some(Self { factor, inverse })
    }

    /// Largest and smallest singular value; `None` where [`NORMAL_IS_SAFE`] is exceeded.
    fn ends(&self) -> Option<[f64; 2]> {
        Some(svd::ends(None, self.factor.as_ref(), self.inverse.as_ref())).filter(is_safe)
    }

    /// `None` also where [`NORMAL_IS_SAFE`] is exceeded.
    fn last_directions(&self, count: usize) -> Option<LastDirections> {
        let first = svd::first_value(&[self.factor.as_ref()]);
        enough(svd::last_directions(self.inverse.as_ref(), first, count)).filter(|last| is_safe(&last.ends()))
    }
}

fn is_safe(&[first, last]: &[f64; 2]) -> bool {
    first <= NORMAL_IS_SAFE * last
}

/// The last directions where they are all that a term acts on: where no more are weak.
fn enough(last: Option<LastDirections>) -> Option<LastDirections> {
    last.filter(|last| last.sigma[0] >= WEAK_SINGULAR_VALUE * last.first)
}
