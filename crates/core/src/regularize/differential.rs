//! Preservation of the rest cage's differential coordinates (Savoye and Franco 2010).

use super::laplacian::cage_laplacian;
use super::{Reference, Term, TermError};
use crate::cage::Cage;
use faer::Mat;

/// Preserves the rest cage's differential coordinates, `λ‖Δ C − Δ C_R‖²` with the cage Laplacian Δ, so that sharp features survive. Not invariant to
/// rotation: parts rotated far from the rest pose shrink in the regularised directions.
#[derive(Clone, Copy, Debug, Default)]
pub struct Differential;

impl Term for Differential {
    fn delta(&self, cage: &Cage, unknowns: usize) -> Result<Mat<f64>, TermError> {
        Ok(cage_laplacian(cage, unknowns))
    }

    fn reference(&self) -> Reference {
        Reference::RestCage
    }
}
