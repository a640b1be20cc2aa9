//! Preservation of the rest cage's differential coordinates (Savoye and Franco 2010).

use super::laplacian::cage_laplacian;
use super::{Reference, Term, TermError};
use crate::cage::Cage;
use faer::Mat;

/// Cages like the rest cage: `λ‖Δ C − Δ C_R‖²` with the cage Laplacian, so that sharp features survive. Not invariant to
/// rotation: parts that turn far from the rest pose shrink, where the term has a say.
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
