//! Motions that are made: recovered from surfaces without correspondence, moved onto other models, and what shapes between poses need. Files in, frames out
//! that are encoded as any capture. The command line and the service share it; it knows neither requests nor options as they are typed.

pub mod pose_cage;
pub mod pose_faces;
pub mod recover;
pub mod transfer;

/// Compiles the examples of the README.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
