//! Motions recovered from surfaces without correspondence and moved onto other models. Files in,
//! frames out that are encoded as any capture. Command line and service share it.

pub mod pose_cage;
pub mod pose_faces;
pub mod recover;
pub mod transfer;

/// Compiles the examples of the README.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
