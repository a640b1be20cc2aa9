//! How a person is fitted.

use cager_core::coordinates::{CoordinateSystem, Green};

/// The recipe.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Method {
    /// Matches both ways by position and normal, robust weights, placement and latent numbers together, quads held to the manifold, then the
    /// vertices of the cage.
    #[default]
    Robust,
    /// The recipe that the paper prints, for comparison: matches by position from the template alone, no weights, placement and latent numbers in
    /// turn, then free quads (§5.2, 5.3, 6.2). The prior has the sign that the text explains, not the one of Eq. 5.
    Paper,
}

/// The coordinates that take people along with their cages, as in the paper: Green's, with normals that follow from the vertices.
pub const COORDINATES: &dyn CoordinateSystem = &Green::Consistent;

/// Weights and numbers of a fit. Lengths are fractions of the template's height.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FitOptions {
    /// The recipe.
    pub method: Method,
    /// Points of the template that are matched.
    pub samples: usize,
    /// Observed points that are matched with the template.
    pub observed: usize,
    /// Unit of distances: about the noise and what a cage cannot follow.
    pub deviation: f64,
    /// Distance at which a match counts half, in units, in the first rounds and in the last.
    pub reach: [f64; 2],
    /// Weight of the manifold's prior.
    pub prior: f64,
    /// How tightly quads are held to the manifold: a weight of one allows 3 % of the height, or two thirds of it in radians.
    pub quads: f64,
    /// How tightly vertices are held to the cage of the quads, by differential coordinates; one allows 0.3 %.
    pub vertices: f64,
    /// How tightly bones keep their lengths; one allows 0.4 %.
    pub bones: f64,
    /// Share of the last fit's offset from the manifold that the next one keeps: the manifold is shifted by it.
    pub carried: f64,
    /// Rounds of Gauss–Newton in a frame that follows another: latent numbers, quads, vertices.
    pub rounds: [usize; 3],
    /// Rounds where there is no frame before.
    pub first_rounds: [usize; 3],
}

impl Default for FitOptions {
    fn default() -> Self {
        Self {
            method: Method::Robust,
            samples: 2500,
            observed: 1500,
            deviation: 0.005,
            reach: [8.0, 4.0],
            prior: 0.3,
            quads: 0.1,
            vertices: 0.003,
            bones: 0.3,
            carried: 0.7,
            rounds: [6, 7, 4],
            first_rounds: [25, 15, 6],
        }
    }
}
