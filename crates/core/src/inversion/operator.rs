//! The linear inversion as one matrix R, `C = R · H`.

use super::PrepareError;
use super::error::failed;
use super::spectra::{EXTREMES_ONLY_FROM, Spectra};
use crate::handles::Handles;
use crate::handles::farthest::farthest_points;
use crate::handles::interpolation::{Drift, Samples, interpolated};
use crate::handles::rectangular::rectangular_rows;
use crate::maxvol::RANK_TOLERANCE;
use crate::regularize::DataMap;
use crate::row_basis::RowBasis;
use cager_geometry::linalg;
use cager_geometry::linalg::svd::{self, LastDirections, Svd};
use cager_geometry::linalg::tall_product;
use cager_geometry::mesh::Point;
use faer::{Mat, MatRef};

/// The singular directions of the inverted matrix A.
pub(super) enum Directions {
    /// All of them: singular values, descending, of which those over the rank count, and right singular vectors, m × m.
    All { sigma: Vec<f64>, v: Mat<f64> },
    /// The last ones alone.
    Last(LastDirections),
}

impl Directions {
    /// Singular values, descending, NaN where they were not computed.
    pub(super) fn values(&self) -> Vec<f64> {
        match self {
            Self::All { sigma, .. } => sigma.clone(),
            Self::Last(last) => last.values(),
        }
    }

    /// Cages from combinations of directions.
    pub(super) fn to_cage(&self, directions: MatRef<'_, f64>) -> Mat<f64> {
        match self {
            Self::All { v, .. } => linalg::product(v.as_ref(), directions),
            Self::Last(_) => directions.to_owned(),
        }
    }
}

/// A choice of handles with the decomposition of what is inverted: `Uᵀ` as a matrix on the rows read, Σ and V. Where only the last directions are
/// known, the inversion without a term takes the place of `Uᵀ`, and the identity that of V.
pub(super) struct Decomposition {
    /// The rows read; where every point is read, those of maximum volume.
    pub(super) handles: Vec<u32>,
    pub(super) reads_all: bool,
    /// Number of rows of the inverted matrix: of the points over which least squares sums. For spread handles these are all points analysed.
    pub(super) rows: usize,
    left: LeftFactor,
    pub(super) rank: usize,
    pub(super) directions: Directions,
    /// Condition number of the rows read.
    pub(super) condition: f64,
}

/// A matrix L with `Uᵀ H = Lᵀ H`, explicit or in factors.
enum LeftFactor {
    /// L, one row per row read × r.
    Rows(Mat<f64>),
    /// `L = Φ T R⁻¹ U`: U, r × r; R, the factor of [`RowBasis::gram_factor`]; and T = `to_basis`, m × r.
    Implicit { u: Mat<f64>, factor: Mat<f64>, to_basis: Mat<f64> },
    /// `L = Φ (RᵀR)⁻¹`: R with `RᵀR = ΦᵀΦ`.
    Normal(Mat<f64>),
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
                if let Some(last) = &spectra.last {
                    let [first, smallest] = last.ends();
                    return Ok(Self {
                        handles: basis.handles.rows.clone(),
                        reads_all: false,
                        rows: basis.rank,
                        left: LeftFactor::Rows(basis.handles.inverse.transpose().to_owned()),
                        rank: basis.rank,
                        directions: Directions::Last(last.clone()),
                        condition: first / smallest,
                    });
                }
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
        let svd = svd::svd(linalg::rows_of(phi, &rows).as_ref()).ok_or(failed(what))?;
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
        let directions = Directions::All { sigma, v };
        Self { rows: handles.len(), handles, reads_all: false, left, rank, directions, condition }
    }

    fn of_all(phi: MatRef<'_, f64>, basis: &RowBasis, spectra: &Spectra) -> Result<Self, PrepareError> {
        let rank = basis.rank;
        let (left, directions) = match whole(phi, rank, spectra)? {
            FullSvd::Direct(Svd { u, sigma, v }) => {
                (LeftFactor::Rows(u.subcols(0, rank).to_owned()), Directions::All { sigma, v })
            }
            FullSvd::Compressed(Svd { u, sigma, v }) => {
                let (u, factor) = (u.subcols(0, rank).to_owned(), spectra.gram_factor.clone());
                let factor = factor.ok_or(failed("factorisation of the handles"))?;
                let left = LeftFactor::Implicit { u, factor, to_basis: basis.to_basis.clone() };
                (left, Directions::All { sigma: sigma.clone(), v: v.clone() })
            }
            FullSvd::Last(last, factor) => (LeftFactor::Normal(factor.to_owned()), Directions::Last(last.clone())),
        };
        let ends = || svd::ends(None, basis.square.as_ref(), basis.handles.inverse.as_ref());
        let [first, last] = spectra.handles_ends.unwrap_or_else(ends);
        let condition = first / last;
        let (handles, rows) = (basis.handles.rows.clone(), phi.nrows());
        Ok(Self { handles, reads_all: true, rows, left, rank, directions, condition })
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
        let full = whole(phi, rank, spectra)?;
        let interpolate = |drift: Drift<'_>| {
            let condition = || condition_of(phi, &handles, drift.others, basis);
            let (left, condition) = rayon::join(|| interpolated(&samples, &drift), condition);
            let left = LeftFactor::Rows(left.ok_or(failed("interpolation between the handles"))?);
            Ok::<_, PrepareError>((left, condition.ok_or(failed("singular value decomposition of the rows"))?))
        };
        let of_others = || linalg::product(linalg::rows_of(phi, others).as_ref(), basis.to_basis.as_ref());
        let ((left, condition), directions) = match full {
            FullSvd::Direct(Svd { u, sigma, v }) => {
                let u = u.as_ref().subcols(0, rank);
                let (inverse, _) = linalg::inverse(linalg::rows_of(u, first).as_ref());
                let others = linalg::product(linalg::rows_of(u, others).as_ref(), inverse.as_ref());
                let (others, of_basis) = (others.as_ref(), inverse.as_ref());
                let drift = Drift { wide: u, others, of_basis, least_squares: &|seen| seen };
                (interpolate(drift)?, Directions::All { sigma, v })
            }
            // Coefficients in the left singular vectors B R⁻¹ U' of Φ.
            FullSvd::Compressed(Svd { u, sigma, v }) => {
                let others = of_others();
                let factor = spectra.gram_factor.as_ref().ok_or(failed("factorisation of the handles"))?;
                let u = u.as_ref().subcols(0, rank);
                let of_basis = linalg::product(u.transpose(), factor.as_ref());
                let least_squares = |seen: Mat<f64>| {
                    let mut of_basis = linalg::product(basis.to_basis.transpose(), seen.as_ref());
                    linalg::solve_lower(factor.transpose(), &mut of_basis);
                    linalg::product(u.transpose(), of_basis.as_ref())
                };
                let (others, of_basis) = (others.as_ref(), of_basis.as_ref());
                let drift = Drift { wide: phi, others, of_basis, least_squares: &least_squares };
                (interpolate(drift)?, Directions::All { sigma: sigma.clone(), v: v.clone() })
            }
            FullSvd::Last(last, factor) => {
                let others = of_others();
                let least_squares = |seen| normal_solution(factor, seen);
                let (others, of_basis) = (others.as_ref(), basis.to_basis.as_ref());
                let drift = Drift { wide: phi, others, of_basis, least_squares: &least_squares };
                (interpolate(drift)?, Directions::Last(last.clone()))
            }
        };
        Ok(Self { handles, reads_all: false, rows: phi.nrows(), left, rank, directions, condition })
    }

    /// `Rᵀ`, one row per row read × m, for `q = data · Uᵀ H`.
    pub(super) fn operator(&self, phi: MatRef<'_, f64>, data: &DataMap) -> Mat<f64> {
        if let (LeftFactor::Rows(left), DataMap::Update(out, of)) = (&self.left, data) {
            let of_left = linalg::product(left.as_ref(), of.transpose());
            return linalg::product(of_left.as_ref(), out.transpose()) + left;
        }
        let to_cage = self.directions.to_cage(data.matrix().as_ref());
        match &self.left {
            LeftFactor::Rows(left) if self.reads_all => tall_product(left.as_ref(), to_cage.transpose()),
            LeftFactor::Rows(left) => linalg::product(left.as_ref(), to_cage.transpose()),
            LeftFactor::Implicit { u, factor, to_basis } => {
                let mut inverse = linalg::product(u.as_ref(), to_cage.transpose());
                linalg::solve_upper(factor.as_ref(), &mut inverse);
                tall_product(phi, linalg::product(to_basis.as_ref(), inverse.as_ref()).as_ref())
            }
            LeftFactor::Normal(factor) => {
                tall_product(phi, normal_solution(factor.as_ref(), to_cage.transpose().to_owned()).as_ref())
            }
        }
    }

    /// `Uᵀ H` of the rows read H, K × columns.
    pub(super) fn project(&self, phi: MatRef<'_, f64>, read: MatRef<'_, f64>) -> Mat<f64> {
        match &self.left {
            LeftFactor::Rows(left) => linalg::product(left.transpose(), read),
            LeftFactor::Implicit { u, factor, to_basis } => {
                let mut of_basis =
                    linalg::product(to_basis.transpose(), linalg::product(phi.transpose(), read).as_ref());
                linalg::solve_lower(factor.transpose(), &mut of_basis);
                linalg::product(u.transpose(), of_basis.as_ref())
            }
            LeftFactor::Normal(factor) => normal_solution(factor.as_ref(), linalg::product(phi.transpose(), read)),
        }
    }
}

/// `(RᵀR)⁻¹ X`.
fn normal_solution(factor: MatRef<'_, f64>, mut x: Mat<f64>) -> Mat<f64> {
    linalg::solve_lower(factor.transpose(), &mut x);
    linalg::solve_upper(factor, &mut x);
    x
}

/// The decomposition of all of `Φ`.
enum FullSvd<'a> {
    /// Of `Φ` itself.
    Direct(Svd),
    /// Of `R Φ□`: `Φ = B Φ□` and `BᵀB = RᵀR`, so that the left singular vectors of `Φ` are `B R⁻¹ U`.
    Compressed(&'a Svd),
    /// The last directions alone, with an upper triangular R for which `RᵀR = ΦᵀΦ`.
    Last(&'a LastDirections, MatRef<'a, f64>),
}

fn whole<'a>(phi: MatRef<'_, f64>, rank: usize, spectra: &'a Spectra) -> Result<FullSvd<'a>, PrepareError> {
    let what = "singular value decomposition of the coordinates";
    if let (Some(last), Some(factor)) = (&spectra.last, &spectra.normal_factor) {
        return Ok(FullSvd::Last(last, factor.as_ref()));
    }
    match &spectra.full {
        Some(full) if full.sigma[0] <= GRAM_IS_SAFE * full.sigma[rank - 1] => Ok(FullSvd::Compressed(full)),
        _ => svd::svd(phi).map(FullSvd::Direct).ok_or(failed(what)),
    }
}

/// Condition number over the rank of the handles' rows of `Φ`; where there are many unknowns, from `B_S = [I; others]`.
fn condition_of(phi: MatRef<'_, f64>, handles: &[u32], others: MatRef<'_, f64>, basis: &RowBasis) -> Option<f64> {
    let (m, rank) = (phi.ncols(), basis.rank);
    if m >= EXTREMES_ONLY_FROM && rank == m {
        let factor = linalg::cholesky(Mat::<f64>::identity(m, m) + linalg::lower_product(others.transpose(), others))?;
        let [first, last] = svd::ends(Some(factor.transpose()), basis.square.as_ref(), basis.handles.inverse.as_ref());
        return Some(first / last);
    }
    let values = svd::singular_values(linalg::upper_factor(linalg::rows_of(phi, handles)).as_ref())?;
    Some(values[0] / values[rank - 1])
}

/// Zero columns up to a whole tile, see `product_columns`.
pub(super) fn padded_to_tiles(mut operator: Mat<f64>) -> Mat<f64> {
    operator.resize_with(operator.nrows(), operator.ncols().next_multiple_of(linalg::TILE_ROWS), |_, _| 0.0);
    operator
}
