//! A choice of rows with the decomposition of the matrix A over which least squares sums.

use super::analysis::{Analysis, directions, enough};
use super::farthest::farthest_points;
use super::interpolation::{Drift, interpolated};
use super::normal_factor::{NormalFactor, RANK_TOLERANCE};
use super::rectangular::rectangular_rows;
use super::row_basis::RowBasis;
use crate::inversion::{Handles, PrepareError, failed};
use cager_geometry::linalg;
use cager_geometry::linalg::svd::{self, LastDirections, Svd};
use faer::{Mat, MatRef};

/// `x = Lᵀ H` of the rows read H, and the singular directions of A: x are the coefficients `Uᵀ H`,
/// or, where only the last directions are known, the cage without a term.
pub(super) struct Decomposition {
    /// The rows read; where every point is read, none.
    pub(super) handles: Vec<u32>,
    pub(super) reads_all: bool,
    /// Number of rows of A. For spread handles these are all points analysed.
    pub(super) rows: usize,
    /// L, one row per row read; where every point is read, W with `L = Φ W`.
    left: Mat<f64>,
    pub(super) rank: usize,
    pub(super) directions: LastDirections,
    /// Condition number of the rows read.
    pub(super) condition: f64,
}

impl Decomposition {
    /// Decomposes the system of a choice of handles.
    pub(super) fn new(analysis: &Analysis, handles: Handles) -> Result<Self, PrepareError> {
        let phi = analysis.found.phi.as_ref();
        let count = handles.count(phi.nrows(), phi.ncols());
        let basis = || analysis.basis.as_ref().ok_or(failed("choice of handles"));
        match handles {
            Handles::MaxVol => Self::of_basis(analysis, basis()?),
            Handles::Rectangular { .. } => {
                Self::of_given_rows(phi, rectangular_rows(phi, basis()?, count), analysis.rank)
            }
            Handles::Spread { .. } => Self::of_samples(analysis, basis()?, count),
            Handles::All => Self::of_all(analysis),
        }
    }

    fn of_basis(analysis: &Analysis, basis: &RowBasis) -> Result<Self, PrepareError> {
        let inverse = basis.handles.inverse.as_ref();
        let square = basis.square.as_ref();
        let last = || {
            let count = analysis.last.filter(|_| basis.rank == basis.square.ncols())?;
            enough(svd::last_directions(inverse, svd::first_value(square), count))
        };
        let handles = basis.handles.rows.clone();
        if analysis.square.is_none()
            && let Some(directions) = last()
        {
            let (left, [first, smallest]) = (inverse.transpose().to_owned(), directions.ends());
            let (rows, rank, condition) = (basis.rank, basis.rank, first / smallest);
            return Ok(Self { handles, reads_all: false, rows, left, rank, directions, condition });
        }
        let known = analysis.square.clone().or_else(|| svd::svd(square));
        Ok(Self::of_rows(handles, basis.rank, known.ok_or(failed("singular value decomposition of the handles"))?))
    }

    /// Decomposes the given rows, with equal weights.
    pub(super) fn of_given_rows(phi: MatRef<'_, f64>, rows: Vec<u32>, rank: usize) -> Result<Self, PrepareError> {
        let what = "singular value decomposition of the rows";
        let svd = svd::svd(linalg::rows_of(phi, &rows).as_ref()).ok_or(failed(what))?;
        let numerical_rank = svd.sigma.iter().filter(|&&x| x > RANK_TOLERANCE * svd.sigma[0]).count();
        if numerical_rank == 0 {
            return Err(failed("choice of rows"));
        }
        Ok(Self::of_rows(rows, rank.min(numerical_rank), svd))
    }

    fn of_rows(handles: Vec<u32>, rank: usize, svd: Svd) -> Self {
        let condition = svd.sigma[0] / svd.sigma[rank - 1];
        let left = svd.u.subcols(0, rank).to_owned();
        Self { rows: handles.len(), handles, reads_all: false, left, rank, directions: directions(svd), condition }
    }

    fn of_all(analysis: &Analysis) -> Result<Self, PrepareError> {
        let (left, directions) = coefficients(analysis)?;
        Ok(Self {
            handles: Vec::new(),
            reads_all: true,
            rows: analysis.found.phi.nrows(),
            left,
            rank: analysis.rank,
            directions: directions.clone(),
            condition: analysis.found.preparation.condition_full,
        })
    }

    /// Decomposes the system of spread handles: all points, interpolated from the samples.
    fn of_samples(analysis: &Analysis, basis: &RowBasis, count: usize) -> Result<Self, PrepareError> {
        let (phi, points) = (analysis.found.phi.as_ref(), &analysis.found.points);
        let (handles, reach) = farthest_points(points, &basis.handles.rows, count);
        let others = linalg::rows_of(phi, &handles[basis.rank..]);
        let others = linalg::product(others.as_ref(), basis.to_basis.as_ref());
        let (to_coefficients, directions) = coefficients(analysis)?;
        // Lᵀ Φ T for the basis B = Φ T: Σ Vᵀ T of coefficients, T itself of cages.
        let of_basis = if is_complete(directions) {
            let seen = Mat::from_fn(basis.rank, phi.ncols(), |k, j| directions.sigma[k] * directions.v[(j, k)]);
            linalg::product(seen.as_ref(), basis.to_basis.as_ref())
        } else {
            basis.to_basis.clone()
        };
        let least_squares = |seen: Mat<f64>| linalg::product(to_coefficients.transpose(), seen.as_ref());
        let (others, of_basis) = (others.as_ref(), of_basis.as_ref());
        let drift = Drift { wide: phi, others, of_basis, least_squares: &least_squares };
        let condition = || {
            let rows = linalg::rows_of(phi, &handles);
            NormalFactor::of(rows.as_ref()).rank_and_condition(None)
        };
        let (left, condition) = rayon::join(|| interpolated(points, &handles, reach, &drift), condition);
        let left = left.ok_or(failed("interpolation between the handles"))?;
        let (_, condition) = condition.ok_or(failed("singular value decomposition of the rows"))?;
        let (rows, rank, directions) = (phi.nrows(), basis.rank, directions.clone());
        Ok(Self { handles, reads_all: false, rows, left, rank, directions, condition })
    }

    /// `Rᵀ`, one row per row read × m, for the cage `to_cage · x`.
    pub(super) fn operator(&self, phi: MatRef<'_, f64>, to_cage: MatRef<'_, f64>) -> Mat<f64> {
        let operator = linalg::product(self.left.as_ref(), to_cage.transpose());
        if self.reads_all { linalg::tall_product(phi, operator.as_ref()) } else { operator }
    }
}

/// W with `x = Wᵀ Φᵀ H` of all points H, m × coefficients, and the singular directions of `Φ`.
fn coefficients(analysis: &Analysis) -> Result<(Mat<f64>, &LastDirections), PrepareError> {
    let no_spectrum = failed("singular value decomposition of the coordinates");
    let directions = analysis.all.as_ref().ok_or(no_spectrum.clone())?;
    let left = if is_complete(directions) {
        let LastDirections { sigma, v, .. } = directions;
        Mat::from_fn(v.nrows(), analysis.rank, |j, k| v[(j, k)] / sigma[k])
    } else {
        analysis.factor.normal_inverse().ok_or(no_spectrum)?
    };
    Ok((left, directions))
}

/// Whether these are all directions.
pub(super) fn is_complete(directions: &LastDirections) -> bool {
    directions.sigma.len() == directions.v.nrows()
}
