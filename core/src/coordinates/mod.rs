//! Cage coordinates: every point as a fixed combination of the cage's unknowns, `P = Φ·C`.

mod careful;
mod doubt;
mod error;
mod green;
mod harmonic;
pub(crate) mod layer;
mod mean_value;

pub use error::CoordinatesError;
pub use green::Green;
pub use harmonic::Harmonic;
pub use mean_value::MeanValue;

use crate::cage::Cage;
use crate::mesh::Point;
use faer::Mat;

/// Coordinates of all points of a model.
#[derive(Clone, Debug)]
pub struct Coordinates {
    /// `Φ`, n × m, column-major.
    pub phi: Mat<f64>,
    /// Points that lie outside the cage, ascending.
    pub outside: Vec<u32>,
}

/// A system of cage coordinates. Every implementation passes the suite in `core/tests/conformance.rs`.
pub trait CoordinateSystem: Sync {
    /// The name on the command line, in reports and in containers.
    fn name(&self) -> &'static str;

    /// Number of unknowns m of a cage.
    fn unknowns(&self, cage: &Cage) -> usize;

    /// The unknowns of the rest pose, m × 3: what `Φ` multiplies to give the rest points.
    fn rest_unknowns(&self, cage: &Cage) -> Vec<Point>;

    /// `Φ` for these points. Rows sum to one; runs on the current rayon pool; the result does not depend on it.
    ///
    /// # Errors
    /// A cage or points for which the system is not defined.
    fn coordinates(&self, cage: &Cage, points: &[Point]) -> Result<Coordinates, CoordinatesError>;
}
