//! Rigs, and subjects followed through surfaces without correspondence.

mod common;
mod correction;
mod fit;
mod observe;
mod rig;
mod track;
mod true_joints;
