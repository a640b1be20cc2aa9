//! The equations that are solved.

use super::elements::Unknowns;
use super::galerkin::{NearPairs, RightHandSides};
use faer::Mat;

/// An element belongs to a vertex's patch where the residual of the low unknowns is above this, as a value on the boundary; the iteration
/// ends where all residuals are below.
pub(super) const RESIDUAL: f64 = 3e-4;

/// The equations of all unknowns.
pub(super) struct Equations<'a> {
    pub(super) near: &'a NearPairs,
    /// The low unknowns with each other, the lower triangle.
    pub(super) far: &'a Mat<f32>,
    pub(super) b: &'a RightHandSides,
    pub(super) unknowns: &'a Unknowns,
}
