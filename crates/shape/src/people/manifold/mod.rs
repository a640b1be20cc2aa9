//! Manifolds of poses: a pose `y` of 126 numbers ([`crate::people::rig::deform`]) by few latent
//! ones.
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
