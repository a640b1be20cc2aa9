//! What moves the points of a mesh beside the transforms above it: skeletons and shapes.

use crate::error::Fault;

/// Moves points before the transforms do.
pub(crate) trait Deformer: Send {
    /// The times at which it says where points are.
    fn times(&self) -> Vec<f64>;

    /// Moves the points of a time, `x y z x y z …`.
    fn deform(&mut self, time: f64, points: &mut [f64]) -> Result<(), Fault>;
}
