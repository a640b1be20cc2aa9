//! Measures of what a motion does to a mesh: how evenly its triangles follow, and how smoothly in time.

pub(crate) mod frame;
mod motion;

pub use frame::{Quality, mean_error};
pub use motion::{MotionQuality, MotionSummary};
