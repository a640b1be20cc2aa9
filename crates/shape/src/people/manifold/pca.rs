//! Principal components of poses: `y = mean + B x`, each latent number of unit variance.

use super::Examples;
use super::error::ManifoldError;
use crate::people::rig::QUAD_UNKNOWNS;
use cager_geometry::linalg::svd::svd;
use serde::{Deserialize, Serialize};

/// A linear manifold of poses.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
pub struct Pca {
    pub(super) mean: Vec<f64>,
    /// One vector for each latent number.
    pub(super) basis: Vec<Vec<f64>>,
    /// Latent numbers of the examples.
    pub(super) latent: Vec<Vec<f64>>,
    /// Mean square of what the components leave of a weighted number.
    pub(super) variance: f64,
}

impl Pca {
    /// The manifold with so many latent numbers.
    ///
    /// # Errors
    /// Where there are not more poses than these.
    pub fn learn(examples: &Examples, dims: usize) -> Result<Self, ManifoldError> {
        let n = examples.len();
        if dims == 0 || dims >= n.min(QUAD_UNKNOWNS) {
            return Err(ManifoldError::TooManyDims { dims, poses: n });
        }
        let found = svd(examples.centered.as_ref()).ok_or(ManifoldError::NotFinite)?;
        let spread = (n as f64).sqrt();
        let sigma: Vec<f64> = found.sigma.iter().take(dims).map(|s| s / spread).collect();
        if sigma.iter().any(|&s| s <= 1e-9 * sigma[0]) {
            return Err(ManifoldError::TooManyDims { dims, poses: n });
        }
        let basis = (0..dims)
            .map(|k| (0..QUAD_UNKNOWNS).map(|j| found.v[(j, k)] * sigma[k] / examples.weights.at(j)).collect())
            .collect();
        let latent = (0..n)
            .map(|i| {
                let along = |k: usize| {
                    (0..QUAD_UNKNOWNS).map(|j| examples.centered[(i, j)] * found.v[(j, k)]).sum::<f64>() / sigma[k]
                };
                (0..dims).map(along).collect()
            })
            .collect();
        let left: f64 = found.sigma.iter().skip(dims).map(|s| s * s).sum();
        let variance = left / (n * QUAD_UNKNOWNS) as f64;
        Ok(Self { mean: examples.mean.clone(), basis, latent, variance })
    }

    /// The pose of latent numbers.
    pub fn pose(&self, x: &[f64]) -> Vec<f64> {
        let mut pose = self.mean.clone();
        for (vector, x) in self.basis.iter().zip(x) {
            pose.iter_mut().zip(vector).for_each(|(y, b)| *y += b * x);
        }
        pose
    }
}
