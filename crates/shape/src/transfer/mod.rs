//! A motion moved from a source onto a target that shares nothing with it; one file a method.

pub mod alignment;
pub mod fitted;
mod fitted_options;
mod needs_cage;
pub(crate) mod pairs;
pub mod placement;
pub mod public;
pub mod public_cage;
mod registered_source;
mod rigid;
mod source;

pub use fitted_options::{FittedOptions, Pose};
pub use needs_cage::needs_cage;
pub use pairs::VertexPair;
pub use rigid::RIGIDITY;
pub use source::Source;
