//! Continuity in time: the cage of the frame before.

use super::laplacian::cage_laplacian;
use super::{Reference, Term, TermError};
use crate::cage::Cage;
use faer::Mat;

/// Cages like the previous frame's: `λ‖Δ C_t − Δ C_{t−1}‖²`, the first frame's like the rest cage. The difference is taken of
/// differential coordinates, so that a capture may travel as fast as it likes.
///
/// Every frame depends on all before it: frames have to be inverted in order, and one cannot be inverted without its
/// predecessor's cage.
#[derive(Clone, Copy, Debug, Default)]
pub struct Temporal;

impl Term for Temporal {
    fn delta(&self, cage: &Cage, unknowns: usize) -> Result<Mat<f64>, TermError> {
        Ok(cage_laplacian(cage, unknowns))
    }

    fn reference(&self) -> Reference {
        Reference::PreviousCage
    }
}
