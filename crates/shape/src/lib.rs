//! Shapes that share nothing: surfaces registered without correspondence, people and other subjects
//! followed through them, motions moved onto other models, and shapes between poses. Knows no
//! files. Results do not depend on the number of threads.

mod canonical;
pub mod deformation;
mod edge_distances;
mod error;
pub mod interpolate;
pub mod people;
mod points;
pub mod quality;
pub mod registration;
mod rotation;
mod similarity;
pub mod tracking;
pub mod transfer;

pub use deformation::{Gradients, Poisson};
pub use error::{MeshError, ShapeError, TransferError};
pub use similarity::Similarity;

/// Compiles the examples of the README.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
