//! Shapes between poses that are found on the cage, fast enough to follow a pointer.

use cager_core::cage::Cage;
use cager_geometry::mesh::Point;
use faer::Mat;

use super::on_mesh::ShapeSpace;
use super::pose_cages::PoseCages;
use crate::error::ShapeError;

/// The shapes that weights of some poses name, of a model in a cage.
pub struct CagedShapes {
    poses: PoseCages,
    space: ShapeSpace,
}

impl CagedShapes {
    /// Of a cage, coordinates in it, n × m with one column a vertex, and two poses or more.
    ///
    /// # Errors
    /// See [`ShapeError`].
    pub fn new(cage: &Cage, phi: Mat<f64>, poses: &[Vec<Point>]) -> Result<Self, ShapeError> {
        let poses = PoseCages::new(cage, phi, poses)?;
        let space = ShapeSpace::new(&cage.mesh().triangles, &poses.cages)?;
        Ok(Self { poses, space })
    }

    /// The shape with these weights, as [`ShapeSpace::shape`] has it on the cage; with all weight
    /// on a pose, that pose.
    ///
    /// # Errors
    /// As [`ShapeSpace::shape`].
    pub fn shape(&self, weights: &[f64]) -> Result<Vec<Point>, ShapeError> {
        let weighted: Vec<(usize, f64)> = weights.iter().copied().enumerate().collect();
        Ok(self.poses.model(&self.space.shape(weights)?, &weighted))
    }

    /// The cage of a shape.
    ///
    /// # Errors
    /// As [`ShapeSpace::shape`].
    pub fn cage(&self, weights: &[f64]) -> Result<Vec<Point>, ShapeError> {
        self.space.shape(weights)
    }
}
