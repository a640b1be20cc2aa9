//! A learned manifold of either kind: poses, derivatives, prior and files.

use super::error::ManifoldError;
use super::{Examples, Gplvm, Pca};
use serde::{Deserialize, Serialize};

/// How poses are learned.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Kind {
    /// Principal components.
    #[default]
    Pca,
    /// A Gaussian process latent variable model with back-constraints.
    Gplvm,
}

/// A manifold of poses.
#[derive(Clone, Debug, Deserialize, Serialize)]
#[serde(tag = "kind", rename_all = "lowercase")]
pub enum Manifold {
    /// A linear one.
    Pca(Pca),
    /// A nonlinear one.
    Gplvm(Gplvm),
}

/// The prior as residuals `r`: `½ Σ r²` is the negative log-likelihood but for a constant.
#[derive(Clone, Debug)]
pub struct Prior {
    /// The residuals.
    pub residuals: Vec<f64>,
    /// Their derivatives, one row of latent numbers for each.
    pub jacobian: Vec<Vec<f64>>,
}

impl Manifold {
    /// Learns a manifold with so many latent numbers.
    ///
    /// # Errors
    /// Where there are not more poses than these.
    pub fn learn(examples: &Examples, kind: Kind, dims: usize) -> Result<Self, ManifoldError> {
        Ok(match kind {
            Kind::Pca => Self::Pca(Pca::learn(examples, dims)?),
            Kind::Gplvm => Self::Gplvm(Gplvm::learn(examples, dims)?),
        })
    }

    /// A manifold from the bytes of its file.
    ///
    /// # Errors
    /// Where the file is not of this form.
    pub fn from_json(bytes: &[u8]) -> Result<Self, ManifoldError> {
        let read: Self = serde_json::from_slice(bytes).map_err(|error| ManifoldError::Syntax(error.to_string()))?;
        let (dims, width) = (read.dims(), crate::people::rig::QUAD_UNKNOWNS);
        let fits = match &read {
            Self::Pca(pca) => {
                pca.mean.len() == width
                    && pca.basis.iter().all(|vector| vector.len() == width)
                    && pca.latent.iter().all(|x| x.len() == dims)
            }
            Self::Gplvm(_) => true,
        };
        if fits && dims > 0 && read.examples() > 0 {
            return Ok(read);
        }
        Err(ManifoldError::Syntax("its numbers do not fit together".to_owned()))
    }

    /// The file of the manifold.
    pub fn to_json(&self) -> String {
        serde_json::to_string(self).unwrap_or_default()
    }

    /// Latent numbers q.
    pub fn dims(&self) -> usize {
        match self {
            Self::Pca(pca) => pca.basis.len(),
            Self::Gplvm(gplvm) => gplvm.dims(),
        }
    }

    /// Number of poses it was learned from.
    pub fn examples(&self) -> usize {
        self.latents().len()
    }

    /// Latent numbers of an example.
    ///
    /// # Panics
    /// For one that there is not.
    pub fn latent(&self, example: usize) -> &[f64] {
        &self.latents()[example]
    }

    fn latents(&self) -> &[Vec<f64>] {
        match self {
            Self::Pca(pca) => &pca.latent,
            Self::Gplvm(gplvm) => gplvm.latents(),
        }
    }

    /// The pose `ŷ(x)` of latent numbers (Eq. 7 of the paper).
    pub fn pose(&self, x: &[f64]) -> Vec<f64> {
        match self {
            Self::Pca(pca) => pca.pose(x),
            Self::Gplvm(gplvm) => gplvm.pose(x),
        }
    }

    /// Derivatives of the pose, one vector of 126 for each latent number (Eq. 8).
    pub fn jacobian(&self, x: &[f64]) -> Vec<Vec<f64>> {
        match self {
            Self::Pca(pca) => pca.basis.clone(),
            Self::Gplvm(gplvm) => gplvm.jacobian(x),
        }
    }

    /// The prior: `½ ‖x‖²` for principal components, `½ log σ²` for a Gaussian process. The printed
    /// `− log σ²` (Eq. 5) would reward poses unlike any example.
    pub fn prior(&self, x: &[f64]) -> Prior {
        match self {
            Self::Pca(_) => {
                let unit = |k: usize| (0..x.len()).map(|j| f64::from(u8::from(j == k))).collect();
                Prior { residuals: x.to_vec(), jacobian: (0..x.len()).map(unit).collect() }
            }
            Self::Gplvm(gplvm) => {
                let (variance, gradient) = gplvm.variance(x);
                // The square root needs a positive argument: over the least variance, and a little.
                let over = (variance / gplvm.noise_variance()).ln().max(1e-4) + 0.1;
                let residual = over.sqrt();
                let scale = 0.5 / (variance * residual);
                Prior { residuals: vec![residual], jacobian: vec![gradient.iter().map(|g| g * scale).collect()] }
            }
        }
    }
}
