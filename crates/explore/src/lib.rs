//! Motions moved from one model onto another that shares nothing with it, and shapes between the poses of one model. Plain data in, plain data out; knows no
//! files. Results do not depend on the number of threads.

pub mod alignment;
mod canonical;
mod correspondence;
pub mod detail;
mod error;
mod gradients;
mod graph;
pub mod interpolate;
mod motion_quality;
mod pairs;
pub mod placement;
mod poisson;
pub mod public_cage;
pub mod quality;
mod rows;
mod similarity;
mod ties;
pub mod transfer;

pub use error::{MeshError, ShapeError, TransferError};
pub use gradients::Gradients;
pub use motion_quality::{MotionQuality, MotionSummary};
pub use poisson::Poisson;
pub use similarity::Similarity;
