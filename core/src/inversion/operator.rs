//! The whole inversion as one matrix R, `C = R · H`.

use super::{BLOCK_ROWS, PrepareError};
use crate::dense;
use crate::handles::Handles;
use crate::handles::farthest::farthest_points;
use crate::handles::interpolation::{Samples, interpolated};
use crate::handles::rectangular::rectangular_rows;
use crate::mesh::Point;
use crate::simd::zeros;
use crate::spectrum::{RANK_TOLERANCE, RowBasis};
use crate::svd::{self, Svd};
use faer::{Mat, MatRef, Par};
use rayon::prelude::*;

/// Decompositions of the handles of maximum volume and of all points.
#[derive(Clone)]
pub(super) struct Spectra {
    pub(super) handles: Svd,
    pub(super) full_sigma: Vec<f64>,
    /// Of `R Φ□`, where a frame is inverted as a whole.
    pub(super) full: Option<Svd>,
}

impl Spectra {
    pub(super) fn of(basis: &RowBasis, whole_frames: bool) -> Result<Self, PrepareError> {
        let (handles, full) = rayon::join(
            || svd::svd(basis.square.as_ref()),
            || {
                let compressed = basis.compressed()?;
                if whole_frames {
                    svd::svd(compressed.as_ref()).map(|svd| (svd.sigma.clone(), Some(svd)))
                } else {
                    Some((svd::singular_values(compressed.as_ref())?, None))
                }
            },
        );
        let handles = handles.ok_or(failed("singular value decomposition of the handles"))?;
        let (full_sigma, full) = full.ok_or(failed("singular value decomposition of the coordinates"))?;
        Ok(Self { handles, full_sigma, full })
    }
}

/// A choice of handles with the decomposition of what is inverted: `Uᵀ` as a matrix on the rows read, Σ and V.
pub(super) struct Decomposed {
    /// The rows read; those of maximum volume where every point is.
    pub(super) handles: Vec<u32>,
    pub(super) reads_all: bool,
    left: Left,
    /// Singular values of the inverted matrix, descending; the first r count.
    pub(super) sigma: Vec<f64>,
    pub(super) rank: usize,
    /// Its right singular vectors, m × m.
    pub(super) v: Mat<f64>,
    /// Condition number of the rows read.
    pub(super) condition: f64,
}

/// A matrix L with `Uᵀ H = Lᵀ H`.
enum Left {
    /// L, one row per row read × r.
    Rows(Mat<f64>),
    /// U of `L = Φ T R⁻¹ U`, r × r; with the factor R, and T, m × r.
    OfPoints { u: Mat<f64>, factor: Mat<f64>, to_basis: Mat<f64> },
}

/// B carries the rounding of `Φ□⁻¹`, which least squares over all points feels beyond this condition.
const GRAM_IS_SAFE: f64 = 1e6;

impl Decomposed {
    /// Reads as `handles` says.
    pub(super) fn new(
        phi: MatRef<'_, f64>,
        points: &[Point],
        basis: &RowBasis,
        spectra: &Spectra,
        handles: Handles,
    ) -> Result<Self, PrepareError> {
        let count = handles.count(phi.nrows(), phi.ncols());
        match handles {
            Handles::MaxVol => Ok(Self::of_rows(basis.handles.rows.clone(), basis.rank, spectra.handles.clone())),
            Handles::Rectangular { .. } => Self::of_given_rows(phi, rectangular_rows(phi, basis, count), basis.rank),
            Handles::Spread { .. } => Self::of_samples(phi, points, basis, spectra, count),
            Handles::All => Self::of_all(phi, basis, spectra),
        }
    }

    /// Reads the given rows, each as important as any other.
    pub(super) fn of_given_rows(phi: MatRef<'_, f64>, rows: Vec<u32>, rank: usize) -> Result<Self, PrepareError> {
        let what = "singular value decomposition of the rows";
        let svd = svd::svd(dense::rows_of(phi, &rows).as_ref()).ok_or(failed(what))?;
        let felt = svd.sigma.iter().filter(|&&x| x > RANK_TOLERANCE * svd.sigma[0]).count();
        if felt == 0 {
            return Err(failed("choice of rows"));
        }
        Ok(Self::of_rows(rows, rank.min(felt), svd))
    }

    fn of_rows(handles: Vec<u32>, rank: usize, svd: Svd) -> Self {
        let Svd { u, sigma, v } = svd;
        let condition = sigma[0] / sigma[rank - 1];
        let left = Left::Rows(u.subcols(0, rank).to_owned());
        Self { handles, reads_all: false, left, sigma, rank, v, condition }
    }

    fn of_all(phi: MatRef<'_, f64>, basis: &RowBasis, spectra: &Spectra) -> Result<Self, PrepareError> {
        let rank = basis.rank;
        let (left, sigma, v) = match whole(phi, rank, spectra)? {
            Whole::Direct(Svd { u, sigma, v }) => (Left::Rows(u.subcols(0, rank).to_owned()), sigma, v),
            Whole::Compressed(svd) => {
                let factor = basis.gram_factor().ok_or(failed("factorisation of the handles"))?;
                let u = svd.u.subcols(0, rank).to_owned();
                let left = Left::OfPoints { u, factor, to_basis: basis.to_basis.clone() };
                (left, svd.sigma.clone(), svd.v.clone())
            }
        };
        let condition = spectra.handles.sigma[0] / spectra.handles.sigma[rank - 1];
        Ok(Self { handles: basis.handles.rows.clone(), reads_all: true, left, sigma, rank, v, condition })
    }

    /// Reads samples and inverts the frame interpolated from them.
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
        let rows = dense::rows_of(phi, &handles);
        let values = svd::singular_values(dense::upper_factor(rows.clone()).as_ref())
            .ok_or(failed("singular value decomposition of the rows"))?;
        let (map, svd) = match whole(phi, rank, spectra)? {
            Whole::Direct(svd) => {
                let u = svd.u.as_ref().subcols(0, rank);
                let sampled = dense::rows_of(u, &handles);
                let gram = Mat::<f64>::identity(rank, rank);
                (interpolated(&samples, u, None, sampled.as_ref(), gram.as_ref()), svd)
            }
            Whole::Compressed(svd) => {
                let to_basis = basis.to_basis.as_ref();
                let sampled = dense::product(rows.as_ref(), to_basis);
                let gram = basis.handles.gram.as_ref();
                let map = interpolated(&samples, phi, Some(to_basis), sampled.as_ref(), gram);
                // Uᵀ N = (R⁻¹ U')ᵀ Bᵀ N
                let mut left = svd.u.subcols(0, rank).to_owned();
                let factor = basis.gram_factor().ok_or(failed("factorisation of the handles"))?;
                solve_upper(factor.as_ref(), &mut left);
                (map.map(|map| dense::product(left.transpose(), map.as_ref())), svd.clone())
            }
        };
        let left = Left::Rows(map.ok_or(failed("interpolation between the handles"))?.transpose().to_owned());
        let condition = values[0] / values[rank - 1];
        Ok(Self { handles, reads_all: false, left, sigma: svd.sigma, rank, v: svd.v, condition })
    }

    /// `Rᵀ`, one row per row read × m, for `q = data · Uᵀ H`.
    pub(super) fn operator(&self, phi: MatRef<'_, f64>, data: MatRef<'_, f64>) -> Mat<f64> {
        let to_cage = dense::product(self.v.as_ref(), data);
        match &self.left {
            Left::Rows(left) if self.reads_all => tall_product(left.as_ref(), to_cage.transpose()),
            Left::Rows(left) => dense::product(left.as_ref(), to_cage.transpose()),
            Left::OfPoints { u, factor, to_basis } => {
                let mut inverse = dense::product(u.as_ref(), to_cage.transpose());
                solve_upper(factor.as_ref(), &mut inverse);
                tall_product(phi, dense::product(to_basis.as_ref(), inverse.as_ref()).as_ref())
            }
        }
    }

    /// `Uᵀ H` of the rows read H, K × columns.
    pub(super) fn project(&self, phi: MatRef<'_, f64>, read: MatRef<'_, f64>) -> Mat<f64> {
        match &self.left {
            Left::Rows(left) => dense::product(left.transpose(), read),
            Left::OfPoints { u, factor, to_basis } => {
                let mut of_basis = dense::product(to_basis.transpose(), dense::product(phi.transpose(), read).as_ref());
                let lower = factor.transpose();
                faer::linalg::triangular_solve::solve_lower_triangular_in_place(lower, of_basis.as_mut(), Par::Seq);
                dense::product(u.transpose(), of_basis.as_ref())
            }
        }
    }
}

/// The decomposition of all of `Φ`.
enum Whole<'a> {
    /// Of `Φ` itself.
    Direct(Svd),
    /// Of `R Φ□`: `Φ = B Φ□` and `BᵀB = RᵀR`, so that the left singular vectors of `Φ` are `B R⁻¹ U`.
    Compressed(&'a Svd),
}

fn whole<'a>(phi: MatRef<'_, f64>, rank: usize, spectra: &'a Spectra) -> Result<Whole<'a>, PrepareError> {
    let what = "singular value decomposition of the coordinates";
    match &spectra.full {
        Some(full) if spectra.full_sigma[0] <= GRAM_IS_SAFE * spectra.full_sigma[rank - 1] => {
            Ok(Whole::Compressed(full))
        }
        _ => svd::svd(phi).map(Whole::Direct).ok_or(failed(what)),
    }
}

/// `R⁻¹ X`, in place.
fn solve_upper(factor: MatRef<'_, f64>, x: &mut Mat<f64>) {
    faer::linalg::triangular_solve::solve_upper_triangular_in_place(factor, x.as_mut(), Par::Seq);
}

pub(super) fn failed(what: &'static str) -> PrepareError {
    PrepareError::NoSolution { what }
}

/// Zero columns up to a whole tile, see [`product_columns`](super::product_columns).
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
