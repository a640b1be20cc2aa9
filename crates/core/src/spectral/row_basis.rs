//! Rank and spectrum of the coordinate matrix, and a well-conditioned basis of its rows.

use super::maxvol::{self, MaxVol};
use cager_geometry::linalg;
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

/// As many handles as columns; `None` where these are dependent to the working precision.
pub(crate) fn row_basis(phi: MatRef<'_, f64>) -> Option<RowBasis> {
    let m = phi.ncols();
    let handles = maxvol::maxvol(phi, maxvol::tolerance(m)).ok()?;
    let square = linalg::rows_of(phi, &handles.rows);
    let to_basis = handles.inverse.clone();
    Some(RowBasis { handles, square, rank: m, to_basis })
}

/// As many handles as the rank, or fewer, by the right singular vectors of `Φ`.
pub(crate) fn deficient_basis(phi: MatRef<'_, f64>, v: MatRef<'_, f64>, mut rank: usize) -> Option<RowBasis> {
    loop {
        // One direction fewer each time a borderline singular value is still too small.
        let range = v.subcols(0, rank);
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
