//! Poses of a rig from motion-capture clips: bones take quads along (Duveau et al. 2012, §6.2).

mod error;
mod names;
mod skeleton;

pub use error::PoseError;
pub use names::{BONES, BoneNames, Naming};
pub use skeleton::SkeletonPoses;
