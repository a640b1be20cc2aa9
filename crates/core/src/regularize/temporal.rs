//! Temporal coherence: regularisation towards the previous frame's cage.

use super::laplacian::cage_laplacian;
use super::{Reference, Term, TermError};
use crate::cage::Cage;
use faer::Mat;

/// Preserves the differential coordinates of the previous frame's cage, `λ‖Δ C_t − Δ C_{t−1}‖²`, and those of the rest cage for the first frame.
/// Global translations are not penalised.
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
