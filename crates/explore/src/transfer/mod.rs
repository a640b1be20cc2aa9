//! A motion moved from a source onto a target that shares nothing with it; one file a method.

pub mod fitted;
mod fitted_options;
mod laid;
mod needs_cage;
pub mod public;
pub mod rigid;
mod source;

pub use crate::pairs::VertexPair;
pub use fitted_options::{FittedOptions, Pose};
pub use needs_cage::needs_cage;
pub use source::Source;
