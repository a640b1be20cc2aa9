//! The decompositions that an analysis computes, and which of them its solvers need.

use super::operator::{GRAM_IS_SAFE, failed};
use super::{PrepareError, SolverOptions};
use crate::dense;
use crate::handles::Handles;
use crate::regularize::{Regularizer, WEAK_SINGULAR_VALUE};
use crate::spectrum::RowBasis;
use crate::svd::{self, LastDirections, Svd};
use faer::Mat;

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
            Self::Last(_, count) if unknowns >= LAST_ALONE && count <= unknowns / MOST_LAST => Some(count.max(1)),
            _ => None,
        }
    }
}

/// From this many unknowns on, only the largest and smallest singular values are computed where no more of a decomposition is needed.
pub(super) const ENDS_ALONE: usize = 512;
/// From this many unknowns on, only the directions that a term acts on are computed.
const LAST_ALONE: usize = 1024;
/// They are found on their own only where they are at most this part of all.
const MOST_LAST: usize = 32;

/// Decompositions of the handles of maximum volume and of all points.
#[derive(Clone)]
pub(super) struct Spectra {
    /// Of `Φ□`; none where at most its extreme singular values are needed.
    pub(super) handles: Option<Svd>,
    /// Largest and smallest singular value of `Φ□` over the rank; NaN where they are not needed.
    pub(super) handles_ends: [f64; 2],
    /// Singular values of `Φ`; none where only the ends are known.
    pub(super) full_sigma: Vec<f64>,
    /// The largest of them, the smallest over the rank, and the last of all.
    pub(super) full_ends: [f64; 3],
    /// Of `R Φ□`, with R from [`RowBasis::gram_factor`]; only where least squares sums over all points.
    pub(super) full: Option<Svd>,
    /// The last directions of what is inverted, `Φ□` or `R Φ□`, in place of its whole decomposition.
    pub(super) last: Option<LastDirections>,
}

impl Spectra {
    pub(super) fn of(basis: &RowBasis, required: RequiredDecompositions) -> Result<Self, PrepareError> {
        let m = basis.square.ncols();
        let (rank, large) = (basis.rank, m >= ENDS_ALONE && basis.rank == m);
        let no_spectrum = failed("singular value decomposition of the coordinates");
        let whole_frames = matches!(required.handles(), None | Some(Handles::All | Handles::Spread { .. }));
        let factor = basis.gram_factor();
        let inverse = basis.handles.inverse.as_ref();
        let last = match required.last(m).filter(|_| large) {
            Some(count) => last_directions(basis, factor.as_ref().filter(|_| whole_frames), count),
            None => None,
        };
        let vectors_of_handles = !large || last.is_none() && matches!(required.handles(), None | Some(Handles::MaxVol));
        let values_of_all = !large || required == RequiredDecompositions::Everything;
        let vectors_of_all = whole_frames && last.is_none();
        let whole = || {
            let factor = factor.as_ref()?;
            if !vectors_of_all && !values_of_all {
                return Some((Vec::new(), None));
            }
            let compressed = dense::product(factor.as_ref(), basis.square.as_ref());
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
        let ends_of_last = last.as_ref().map(LastDirections::ends);
        let full_ends = match (full_sigma.last(), ends_of_last) {
            (Some(&last), _) => [full_sigma[0], full_sigma[rank - 1], last],
            (None, Some([first, last])) if whole_frames => [first, last, last],
            _ => {
                let [first, last] = svd::ends(factor.ok_or(no_spectrum)?.as_ref(), basis.square.as_ref(), inverse);
                [first, last, last]
            }
        };
        let handles_ends = match (&handles, required.handles()) {
            (Some(svd), _) => [svd.sigma[0], svd.sigma[rank - 1]],
            (None, Some(Handles::MaxVol)) => ends_of_last.unwrap_or([f64::NAN; 2]),
            (None, Some(Handles::All)) => svd::ends(Mat::identity(m, m).as_ref(), basis.square.as_ref(), inverse),
            (None, _) => [f64::NAN; 2],
        };
        Ok(Self { handles, handles_ends, full_sigma, full_ends, full, last })
    }
}

/// The last directions of `R Φ□`, or without R of `Φ□`; `None` where they do not converge, or where they would not be enough: where more
/// directions are weak, or where [`GRAM_IS_SAFE`] is exceeded.
fn last_directions(basis: &RowBasis, factor: Option<&Mat<f64>>, count: usize) -> Option<LastDirections> {
    let (square, mut inverse) = (basis.square.as_ref(), basis.handles.inverse.clone());
    let first = match factor {
        // X R = Φ□⁻¹, transposed.
        Some(factor) => {
            let mut transposed = inverse.transpose().to_owned();
            dense::solve_lower(factor.transpose(), &mut transposed);
            inverse = transposed.transpose().to_owned();
            svd::first_value(factor.as_ref(), square)
        }
        None => svd::first_value(Mat::identity(square.ncols(), square.ncols()).as_ref(), square),
    };
    let last = svd::last_directions(inverse, first, count)?;
    let is_safe = factor.is_none() || first <= GRAM_IS_SAFE * last.sigma[count - 1];
    (is_safe && last.sigma[0] >= WEAK_SINGULAR_VALUE * first).then_some(last)
}
