//! The poses that a manifold is learned from.

use super::error::ManifoldError;
use crate::people::rig::{QUAD_UNKNOWNS, Rig, extent};
use cager_geometry::linalg::zeros;
use cager_geometry::mesh::Point;
use faer::Mat;
use serde::{Deserialize, Serialize};

/// What numbers of a pose count: positions in seventeenths of the height, rotations 1.5 a radian.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize)]
pub struct PoseWeights {
    /// What a unit of length counts.
    pub position: f64,
    /// What a radian counts.
    pub rotation: f64,
}

impl PoseWeights {
    /// Those of a rig.
    pub fn of(rig: &Rig) -> Self {
        let corners: Vec<Point> = rig.quads.iter().flat_map(|quad| quad.corners).collect();
        Self { position: 17.0 / extent(&corners, rig.up), rotation: 1.5 }
    }

    /// The weight of a number of a pose.
    pub fn at(&self, number: usize) -> f64 {
        if number % 6 < 3 { self.position } else { self.rotation }
    }
}

/// Weighted poses around their mean.
#[derive(Clone, Debug)]
pub struct Examples {
    pub(super) weights: PoseWeights,
    pub(super) mean: Vec<f64>,
    /// One row for each example: `(y − mean) · weight`.
    pub(super) centered: Mat<f64>,
}

impl Examples {
    /// Poses of a rig, from one clip or several.
    ///
    /// # Errors
    /// With fewer than two poses, or numbers that are not finite.
    pub fn new(rig: &Rig, poses: &[Vec<f64>]) -> Result<Self, ManifoldError> {
        if poses.len() < 2 || poses.iter().any(|pose| pose.len() != QUAD_UNKNOWNS) {
            return Err(ManifoldError::TooFewPoses(poses.len()));
        }
        if poses.iter().flatten().any(|x| !x.is_finite()) {
            return Err(ManifoldError::NotFinite);
        }
        let weights = PoseWeights::of(rig);
        let n = poses.len();
        let mean: Vec<f64> =
            (0..QUAD_UNKNOWNS).map(|j| poses.iter().map(|pose| pose[j]).sum::<f64>() / n as f64).collect();
        let mut centered = zeros(n, QUAD_UNKNOWNS);
        for (i, pose) in poses.iter().enumerate() {
            for j in 0..QUAD_UNKNOWNS {
                centered[(i, j)] = (pose[j] - mean[j]) * weights.at(j);
            }
        }
        Ok(Self { weights, mean, centered })
    }

    /// Number of poses.
    pub fn len(&self) -> usize {
        self.centered.nrows()
    }

    /// Whether there are none, which cannot be.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}
