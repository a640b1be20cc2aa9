//! Paths through poses.

use std::iter::FusedIterator;

use cager_core::cage::Cage;
use cager_geometry::mesh::Point;
use faer::Mat;

use super::on_mesh::ShapeSpace;
use super::pose_cages::PoseCages;
use super::poses::check_poses;
use crate::error::ShapeError;

/// The shapes on a path from pose to pose. Between two poses it depends on these alone, each way
/// the shorter one. An error is the last item; [`Self::leg`] says where it was.
pub struct ShapePath {
    triangles: Vec<[u32; 3]>,
    keys: Keys,
    steps: usize,
    /// Between the key `from` and the next one.
    space: ShapeSpace,
    from: usize,
    step: usize,
    /// There was an error, after which there is nothing more.
    failed: bool,
}

enum Keys {
    Poses(Vec<Vec<Point>>),
    Cages(PoseCages),
}

impl Keys {
    fn list(&self) -> &[Vec<Point>] {
        match self {
            Self::Poses(poses) => poses,
            Self::Cages(poses) => &poses.cages,
        }
    }
}

impl ShapePath {
    /// Through two poses or more of one mesh, in `steps` shapes from each to the next, two at
    /// least, ends included but not repeated.
    ///
    /// # Errors
    /// See [`ShapeError`].
    pub fn on_mesh(triangles: &[[u32; 3]], poses: Vec<Vec<Point>>, steps: usize) -> Result<Self, ShapeError> {
        check_poses(&poses)?;
        Self::new(triangles, Keys::Poses(poses), steps)
    }

    /// As [`Self::on_mesh`], on the cage, with coordinates as for
    /// [`CagedShapes`](super::CagedShapes).
    ///
    /// # Errors
    /// See [`ShapeError`].
    pub fn on_cage(cage: &Cage, phi: Mat<f64>, poses: &[Vec<Point>], steps: usize) -> Result<Self, ShapeError> {
        Self::new(&cage.mesh().triangles, Keys::Cages(PoseCages::new(cage, phi, poses)?), steps)
    }

    fn new(triangles: &[[u32; 3]], keys: Keys, steps: usize) -> Result<Self, ShapeError> {
        let space = ShapeSpace::new(triangles, &keys.list()[..2])?;
        Ok(Self { triangles: triangles.to_vec(), keys, steps: steps.max(2), space, from: 0, step: 0, failed: false })
    }

    /// The pose, from 0, that begins the stretch of the last shape or of the error.
    pub fn leg(&self) -> usize {
        self.from
    }

    fn shape(&mut self) -> Result<Vec<Point>, ShapeError> {
        if self.step == self.steps {
            (self.from, self.step) = (self.from + 1, 1);
            self.space = ShapeSpace::new(&self.triangles, &self.keys.list()[self.from..self.from + 2])?;
        }
        let share = self.step as f64 / (self.steps - 1) as f64;
        self.step += 1;
        let shape = self.space.shape(&[1.0 - share, share])?;
        Ok(match &self.keys {
            Keys::Poses(_) => shape,
            Keys::Cages(poses) => poses.model(&shape, &[(self.from, 1.0 - share), (self.from + 1, share)]),
        })
    }
}

impl Iterator for ShapePath {
    type Item = Result<Vec<Point>, ShapeError>;

    fn next(&mut self) -> Option<Self::Item> {
        (self.len() > 0).then(|| {
            let shape = self.shape();
            self.failed = shape.is_err();
            shape
        })
    }

    fn size_hint(&self) -> (usize, Option<usize>) {
        if self.failed {
            return (0, Some(0));
        }
        let stretches = self.keys.list().len() - 1 - self.from;
        let left = stretches * (self.steps - 1) + 1 - self.step;
        (left, Some(left))
    }
}

impl ExactSizeIterator for ShapePath {}

impl FusedIterator for ShapePath {}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_path_ends_at_an_error_and_tells_its_leg() {
        let triangles = [[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]];
        let pose = vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        let mut path = ShapePath::on_mesh(&triangles, vec![pose; 4], 3).unwrap();
        if let Keys::Poses(poses) = &mut path.keys {
            poses[2][0][0] = f64::NAN;
        }
        assert!((0..3).all(|_| path.next().is_some_and(|shape| shape.is_ok())) && path.leg() == 0);
        assert!(path.next().is_some_and(|shape| shape.is_err()) && path.leg() == 1);
        assert!(path.next().is_none() && path.len() == 0 && path.leg() == 1);
    }
}
