//! How a person is fitted.

use cager_core::coordinates::{CoordinateSystem, Green};

/// The recipe.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Method {
    /// Matches both ways by position and normal, robust weights, quads held to the manifold, then
    /// the vertices of the cage.
    #[default]
    Robust,
    /// The printed recipe, for comparison: matches by position from the template alone, no weights,
    /// placement and latent numbers in turn, then free quads (§5.2, 5.3, 6.2). The prior has the
    /// sign that the text explains, not the one of Eq. 5.
    Paper,
}

/// The paper's coordinates: Green's, with normals that follow from the vertices.
pub const COORDINATES: &dyn CoordinateSystem = &Green::Consistent;

/// Points of the template that are matched.
pub const SAMPLES: usize = 2500;
/// Observed points that are matched with the template.
pub(super) const OBSERVED: usize = 1500;
/// Unit of distances, over the height: about the noise and what a cage cannot follow.
pub(super) const DEVIATION: f64 = 0.005;
/// Distance at which a match counts half, in units, in the first rounds and in the last.
pub(super) const REACH: [f64; 2] = [8.0, 4.0];
/// Weight of the manifold's prior.
pub(super) const PRIOR: f64 = 0.3;
/// Share of the last fit's offset from the manifold that the next one keeps.
pub(super) const CARRIED: f64 = 0.7;
/// Rounds of latent numbers, quads and vertices in a frame that follows another, and in one that
/// does not.
pub(super) const ROUNDS: [usize; 3] = [6, 7, 4];
pub(super) const FIRST_ROUNDS: [usize; 3] = [25, 15, 6];

/// The recipe of a fit, and its weights.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FitOptions {
    /// The recipe.
    pub method: Method,
    /// How tightly quads are held to the manifold; one allows 3 % of the height, two thirds in
    /// radians.
    pub quads: f64,
    /// How tightly vertices are held to the quads' cage, by differential coordinates; one allows
    /// 0.3 %.
    pub vertices: f64,
    /// How tightly bones keep their lengths; one allows 0.4 %.
    pub bones: f64,
}

impl Default for FitOptions {
    fn default() -> Self {
        Self { method: Method::Robust, quads: 0.1, vertices: 0.003, bones: 0.3 }
    }
}
