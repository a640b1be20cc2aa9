//! Animated meshes and their cages to bytes and back, with a bound on the error of every vertex.
//!
//! Entropy decoding and its predictions are of whole numbers alone, so that machines decode the
//! same numbers, and positions that differ by rounding alone.

mod basis;
mod cage;
mod components;
mod connectivity;
mod corrections;
mod entropy;
mod error;
mod fenwick;
mod frame_errors;
mod gates;
mod gram_rounding;
mod grid;
mod hierarchy;
mod histograms;
mod mesh;
mod open_edges;
mod parallelograms;
mod prediction_weights;
mod residual;
mod surface;
mod trajectories;
mod vertex_order;
mod walk;

pub use basis::{BasisRecord, CageBasis};
pub use cage::{AdjacentGroups, basis_record, decode_cages, encode_cages};
pub use connectivity::decode_faces;
pub use error::Error;
pub use frame_errors::{decode_errors, encode_errors, rounded_error};
pub use gram_rounding::GramRounding;
pub use grid::{Grid, decode_positions, encode_positions};
pub use hierarchy::Hierarchy;
pub use mesh::CodedMesh;
pub use residual::{Residual, ResidualGroup, encode_residual, estimate_residual};
pub use surface::CodedSurface;

/// Most positions, points times frames, of a group: memory of decoding follows from it.
pub const MAX_POSITIONS: usize = 1 << 26;
/// Most frames of a group.
pub const MAX_FRAMES: usize = 1024;
/// Most rows of a cage.
pub const MAX_ROWS: usize = 4096;

/// Compiles the examples of the README.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
