//! What a motion does to a mesh: how evenly its triangles follow, and how smoothly in time.

mod frame;
mod motion;

pub use frame::Quality;
pub use motion::{MotionQuality, MotionSummary};
