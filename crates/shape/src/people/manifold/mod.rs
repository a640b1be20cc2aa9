//! Manifolds of poses, learned from examples: a pose `y` of 126 numbers (see [`crate::people::rig::deform`]) as a function of few latent numbers `x`.
//!
//! What each number counts is said by [`PoseWeights`].

mod descent;
mod error;
mod examples;
mod gplvm;
mod model;
mod pca;

pub use error::ManifoldError;
pub use examples::{Examples, PoseWeights};
pub use gplvm::Gplvm;
pub use model::{Kind, Manifold, Prior};
pub use pca::Pca;
