//! The linear inversion as one matrix R, `C = R · H`.

use super::{BLOCK_ROWS, PrepareError};
use crate::dense;
use crate::handles::Handles;
use crate::handles::farthest::farthest_points;
use crate::handles::interpolation::{Drift, Samples, interpolated};
use crate::handles::rectangular::rectangular_rows;
use crate::mesh::Point;
use crate::simd::zeros;
use crate::spectrum::{RANK_TOLERANCE, RowBasis};
use crate::svd::{self, Svd};
use faer::{Mat, MatRef};
use rayon::prelude::*;

/// Which decompositions to compute.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum RequiredDecompositions {
    /// All of them.
    Everything,
    /// What solvers that read these handles need.
    For(Handles),
}

/// From this many unknowns on, only the largest and smallest singular values are computed where no more of a decomposition is needed.
const ENDS_ALONE: usize = 512;

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
}

impl Spectra {
    pub(super) fn of(basis: &RowBasis, required: RequiredDecompositions) -> Result<Self, PrepareError> {
        let m = basis.square.ncols();
        let (rank, large) = (basis.rank, m >= ENDS_ALONE && basis.rank == m);
        let whole_frames = matches!(
            required,
            RequiredDecompositions::Everything | RequiredDecompositions::For(Handles::All | Handles::Spread { .. })
        );
        let vectors_of_handles = !large
            || matches!(required, RequiredDecompositions::Everything | RequiredDecompositions::For(Handles::MaxVol));
        let values_of_all = !large || required == RequiredDecompositions::Everything;
        let factor = basis.gram_factor();
        let whole = || {
            let factor = factor.as_ref()?;
            if !whole_frames && !values_of_all {
                return Some((Vec::new(), None));
            }
            let compressed = dense::product(factor.as_ref(), basis.square.as_ref());
            if whole_frames {
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
        let no_spectrum = failed("singular value decomposition of the coordinates");
        let (full_sigma, full) = full.ok_or(no_spectrum.clone())?;
        let inverse = basis.handles.inverse.as_ref();
        let full_ends = match full_sigma.last() {
            Some(&last) => [full_sigma[0], full_sigma[rank - 1], last],
            None => {
                let [first, last] = svd::ends(factor.ok_or(no_spectrum)?.as_ref(), basis.square.as_ref(), inverse);
                [first, last, last]
            }
        };
        let handles_ends = match (&handles, required) {
            (Some(svd), _) => [svd.sigma[0], svd.sigma[rank - 1]],
            (None, RequiredDecompositions::For(Handles::All)) => {
                svd::ends(Mat::identity(m, m).as_ref(), basis.square.as_ref(), inverse)
            }
            (None, _) => [f64::NAN; 2],
        };
        Ok(Self { handles, handles_ends, full_sigma, full_ends, full })
    }
}

/// A choice of handles with the decomposition of what is inverted: `Uᵀ` as a matrix on the rows read, Σ and V.
pub(super) struct Decomposition {
    /// The rows read; where every point is read, those of maximum volume.
    pub(super) handles: Vec<u32>,
    pub(super) reads_all: bool,
    /// Number of rows of the inverted matrix: of the points over which least squares sums. For spread handles these are all points analysed.
    pub(super) rows: usize,
    left: LeftFactor,
    /// Singular values of the inverted matrix, descending; the first r count.
    pub(super) sigma: Vec<f64>,
    pub(super) rank: usize,
    /// Its right singular vectors, m × m.
    pub(super) v: Mat<f64>,
    /// Condition number of the rows read.
    pub(super) condition: f64,
}

/// A matrix L with `Uᵀ H = Lᵀ H`, explicit or in factors.
enum LeftFactor {
    /// L, one row per row read × r.
    Rows(Mat<f64>),
    /// `L = Φ T R⁻¹ U`: U, r × r; R, here the factor of [`RowBasis::gram_factor`]; and T = `to_basis`, m × r.
    Implicit { u: Mat<f64>, factor: Mat<f64>, to_basis: Mat<f64> },
}

/// Condition number of `Φ` up to which the rounding of `Φ□⁻¹` in B is negligible for least squares over all points.
const GRAM_IS_SAFE: f64 = 1e6;

impl Decomposition {
    /// Decomposes the system of a choice of handles.
    pub(super) fn new(
        phi: MatRef<'_, f64>,
        points: &[Point],
        basis: &RowBasis,
        spectra: &Spectra,
        handles: Handles,
    ) -> Result<Self, PrepareError> {
        let count = handles.count(phi.nrows(), phi.ncols());
        match handles {
            Handles::MaxVol => {
                let known = spectra.handles.clone().or_else(|| svd::svd(basis.square.as_ref()));
                let svd = known.ok_or(failed("singular value decomposition of the handles"))?;
                Ok(Self::of_rows(basis.handles.rows.clone(), basis.rank, svd))
            }
            Handles::Rectangular { .. } => Self::of_given_rows(phi, rectangular_rows(phi, basis, count), basis.rank),
            Handles::Spread { .. } => Self::of_samples(phi, points, basis, spectra, count),
            Handles::All => Self::of_all(phi, basis, spectra),
        }
    }

    /// Decomposes the given rows, with equal weights.
    pub(super) fn of_given_rows(phi: MatRef<'_, f64>, rows: Vec<u32>, rank: usize) -> Result<Self, PrepareError> {
        let what = "singular value decomposition of the rows";
        let svd = svd::svd(dense::rows_of(phi, &rows).as_ref()).ok_or(failed(what))?;
        let numerical_rank = svd.sigma.iter().filter(|&&x| x > RANK_TOLERANCE * svd.sigma[0]).count();
        if numerical_rank == 0 {
            return Err(failed("choice of rows"));
        }
        Ok(Self::of_rows(rows, rank.min(numerical_rank), svd))
    }

    fn of_rows(handles: Vec<u32>, rank: usize, svd: Svd) -> Self {
        let Svd { u, sigma, v } = svd;
        let condition = sigma[0] / sigma[rank - 1];
        let left = LeftFactor::Rows(u.subcols(0, rank).to_owned());
        Self { rows: handles.len(), handles, reads_all: false, left, sigma, rank, v, condition }
    }

    fn of_all(phi: MatRef<'_, f64>, basis: &RowBasis, spectra: &Spectra) -> Result<Self, PrepareError> {
        let rank = basis.rank;
        let (left, sigma, v) = match whole(phi, rank, spectra)? {
            FullSvd::Direct(Svd { u, sigma, v }) => (LeftFactor::Rows(u.subcols(0, rank).to_owned()), sigma, v),
            FullSvd::Compressed(svd) => {
                let factor = basis.gram_factor().ok_or(failed("factorisation of the handles"))?;
                let u = svd.u.subcols(0, rank).to_owned();
                let left = LeftFactor::Implicit { u, factor, to_basis: basis.to_basis.clone() };
                (left, svd.sigma.clone(), svd.v.clone())
            }
        };
        let [first, last] = match spectra.handles_ends {
            // Not computed with the other decompositions.
            [first, _] if first.is_nan() => {
                let m = phi.ncols();
                svd::ends(Mat::identity(m, m).as_ref(), basis.square.as_ref(), basis.handles.inverse.as_ref())
            }
            known => known,
        };
        let condition = first / last;
        let (handles, rows) = (basis.handles.rows.clone(), phi.nrows());
        Ok(Self { handles, reads_all: true, rows, left, sigma, rank, v, condition })
    }

    /// Decomposes the system of spread handles: all points, interpolated from the samples.
    fn of_samples(
        phi: MatRef<'_, f64>,
        points: &[Point],
        basis: &RowBasis,
        spectra: &Spectra,
        count: usize,
    ) -> Result<Self, PrepareError> {
        let rank = basis.rank;
        let (handles, reach) = farthest_points(points, &basis.handles.rows, count);
        let samples = Samples { points, rows: &handles, reach };
        let (first, others) = handles.split_at(rank);
        let (map, others, svd) = match whole(phi, rank, spectra)? {
            FullSvd::Direct(svd) => {
                let u = svd.u.as_ref().subcols(0, rank);
                let (inverse, _) = dense::inverse(dense::rows_of(u, first).as_ref());
                let others = dense::product(dense::rows_of(u, others).as_ref(), inverse.as_ref());
                let drift = Drift { wide: u, to_basis: None, others: others.as_ref(), gram: inverse.as_ref() };
                (interpolated(&samples, &drift), others, svd)
            }
            FullSvd::Compressed(svd) => {
                let (to_basis, gram) = (basis.to_basis.as_ref(), basis.handles.gram.as_ref());
                let others = dense::product(dense::rows_of(phi, others).as_ref(), to_basis);
                let drift = Drift { wide: phi, to_basis: Some(to_basis), others: others.as_ref(), gram };
                let map = interpolated(&samples, &drift);
                // Uᵀ N = (R⁻¹ U')ᵀ Bᵀ N
                let mut left = svd.u.subcols(0, rank).to_owned();
                let factor = basis.gram_factor().ok_or(failed("factorisation of the handles"))?;
                dense::solve_upper(factor.as_ref(), &mut left);
                (map.map(|map| dense::product(left.transpose(), map.as_ref())), others, svd.clone())
            }
        };
        let condition = condition_of(phi, &handles, others.as_ref(), basis)
            .ok_or(failed("singular value decomposition of the rows"))?;
        let left = LeftFactor::Rows(map.ok_or(failed("interpolation between the handles"))?.transpose().to_owned());
        Ok(Self { handles, reads_all: false, rows: phi.nrows(), left, sigma: svd.sigma, rank, v: svd.v, condition })
    }

    /// `Rᵀ`, one row per row read × m, for `q = data · Uᵀ H`.
    pub(super) fn operator(&self, phi: MatRef<'_, f64>, data: MatRef<'_, f64>) -> Mat<f64> {
        let to_cage = dense::product(self.v.as_ref(), data);
        match &self.left {
            LeftFactor::Rows(left) if self.reads_all => tall_product(left.as_ref(), to_cage.transpose()),
            LeftFactor::Rows(left) => dense::product(left.as_ref(), to_cage.transpose()),
            LeftFactor::Implicit { u, factor, to_basis } => {
                let mut inverse = dense::product(u.as_ref(), to_cage.transpose());
                dense::solve_upper(factor.as_ref(), &mut inverse);
                tall_product(phi, dense::product(to_basis.as_ref(), inverse.as_ref()).as_ref())
            }
        }
    }

    /// `Uᵀ H` of the rows read H, K × columns.
    pub(super) fn project(&self, phi: MatRef<'_, f64>, read: MatRef<'_, f64>) -> Mat<f64> {
        match &self.left {
            LeftFactor::Rows(left) => dense::product(left.transpose(), read),
            LeftFactor::Implicit { u, factor, to_basis } => {
                let mut of_basis = dense::product(to_basis.transpose(), dense::product(phi.transpose(), read).as_ref());
                let lower = factor.transpose();
                faer::linalg::triangular_solve::solve_lower_triangular_in_place(
                    lower,
                    of_basis.as_mut(),
                    faer::Par::Seq,
                );
                dense::product(u.transpose(), of_basis.as_ref())
            }
        }
    }
}

/// The decomposition of all of `Φ`.
enum FullSvd<'a> {
    /// Of `Φ` itself.
    Direct(Svd),
    /// Of `R Φ□`: `Φ = B Φ□` and `BᵀB = RᵀR`, so that the left singular vectors of `Φ` are `B R⁻¹ U`.
    Compressed(&'a Svd),
}

fn whole<'a>(phi: MatRef<'_, f64>, rank: usize, spectra: &'a Spectra) -> Result<FullSvd<'a>, PrepareError> {
    let what = "singular value decomposition of the coordinates";
    match &spectra.full {
        Some(full) if full.sigma[0] <= GRAM_IS_SAFE * full.sigma[rank - 1] => Ok(FullSvd::Compressed(full)),
        _ => svd::svd(phi).map(FullSvd::Direct).ok_or(failed(what)),
    }
}

/// Condition number over the rank of the handles' rows of `Φ`; where there are many unknowns, from `B_S = [I; others]`.
fn condition_of(phi: MatRef<'_, f64>, handles: &[u32], others: MatRef<'_, f64>, basis: &RowBasis) -> Option<f64> {
    let (m, rank) = (phi.ncols(), basis.rank);
    if m >= ENDS_ALONE && rank == m {
        let factor = dense::cholesky(Mat::<f64>::identity(m, m) + dense::product(others.transpose(), others))?;
        let [first, last] = svd::ends(factor.transpose(), basis.square.as_ref(), basis.handles.inverse.as_ref());
        return Some(first / last);
    }
    let values = svd::singular_values(dense::upper_factor(dense::rows_of(phi, handles)).as_ref())?;
    Some(values[0] / values[rank - 1])
}

pub(super) fn failed(what: &'static str) -> PrepareError {
    PrepareError::NoSolution { what }
}

/// Zero columns up to a whole tile, see [`product_columns`](super::product_columns).
pub(super) fn padded_to_tiles(mut operator: Mat<f64>) -> Mat<f64> {
    operator.resize_with(operator.nrows(), operator.ncols().next_multiple_of(dense::TILE_ROWS), |_, _| 0.0);
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
