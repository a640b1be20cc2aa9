//! Rank and spectrum of the coordinate matrix, and a well-conditioned basis of its rows.

use crate::maxvol::{self, MaxVol, RANK_TOLERANCE};
use cager_geometry::linalg;
use cager_geometry::linalg::svd::Svd;
use faer::{Mat, MatRef};

/// `Φ = B Φ□`: handles of maximum volume, with what the inversion needs of B.
pub(crate) struct RowBasis {
    /// The handles and `Bᵀ B`.
    pub(crate) handles: MaxVol,
    /// `Φ□`, r × m.
    pub(crate) square: Mat<f64>,
    /// Numerical rank r of `Φ`.
    pub(crate) rank: usize,
    /// `B = Φ · to_basis`, m × r.
    pub(crate) to_basis: Mat<f64>,
}

/// Picks the handles. Where columns of `Φ` are dependent, only as many as its rank.
///
/// `None` where a decomposition does not converge.
pub(crate) fn row_basis(phi: MatRef<'_, f64>) -> Option<RowBasis> {
    let m = phi.ncols();
    if let Ok(handles) = maxvol::maxvol(phi, maxvol::tolerance(m)) {
        let square = linalg::rows_of(phi, &handles.rows);
        let to_basis = handles.inverse.clone();
        return Some(RowBasis { handles, square, rank: m, to_basis });
    }
    deficient_basis(phi)
}

/// Fewer handles than columns, for a `Φ` whose columns are dependent to the working precision.
///
/// `None` where a decomposition does not converge.
pub(crate) fn deficient_basis(phi: MatRef<'_, f64>) -> Option<RowBasis> {
    let Svd { sigma, v, .. } = linalg::right_singular(phi.to_owned())?;
    let mut rank = sigma.iter().filter(|&&s| s > RANK_TOLERANCE * sigma[0]).count();
    loop {
        // Coordinates in the right singular vectors of the rank, one fewer each time a borderline singular value is still too small.
        let range = v.as_ref().subcols(0, rank);
        let projected = linalg::tall_product(phi, range);
        match maxvol::maxvol(projected.as_ref(), maxvol::tolerance(rank)) {
            Ok(handles) => {
                let square = linalg::rows_of(phi, &handles.rows);
                let to_basis = linalg::product(range, handles.inverse.as_ref());
                return Some(RowBasis { handles, square, rank, to_basis });
            }
            Err(_) if rank > 1 => rank -= 1,
            Err(_) => return None,
        }
    }
}

impl RowBasis {
    /// Upper triangular R with `BᵀB = RᵀR`, so that `R Φ□` has the singular values and right vectors of `Φ`.
    pub(crate) fn gram_factor(&self, phi: MatRef<'_, f64>) -> Option<Mat<f64>> {
        let gram = match &self.handles.gram {
            Some(gram) => gram.clone(),
            None => maxvol::maxima_and_gram(phi, self.to_basis.as_ref(), f64::INFINITY).1,
        };
        Some(linalg::cholesky(gram)?.transpose().to_owned())
    }
}
