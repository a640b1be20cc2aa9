//! Manifolds of poses, learned from examples: a pose `y` of 126 numbers (see [`crate::rig::deform`]) as a function of few latent numbers `x`.
//!
//! What each number counts is said by [`PoseWeights`].

mod descent;
mod examples;
mod gplvm;
mod model;
mod pca;

pub use examples::{Examples, PoseWeights};
pub use gplvm::{Gplvm, GplvmOptions};
pub use model::{Kind, Manifold, ManifoldError, Prior};
pub use pca::Pca;
