//! What can be wrong with a manifold.

/// Why a manifold cannot be learned or read.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ManifoldError {
    /// Fewer than two poses: how many there are.
    #[error("has {0} poses, and two are the least; give longer clips")]
    TooFewPoses(usize),
    /// As many latent numbers as poses.
    #[error("{dims} dimensions cannot be learned from {poses} poses; ask for fewer, or give more clips")]
    TooManyDims {
        /// Latent numbers asked for.
        dims: usize,
        /// Poses, of which some may be equal.
        poses: usize,
    },
    /// A number that is NaN or infinite.
    #[error("has a number that is NaN or infinite")]
    NotFinite,
    /// The file is no JSON, or not of this form.
    #[error("is no manifold of poses ({0}); write it with `cager manifold`")]
    Syntax(String),
}
