//! The mathematics of CageR: plain data in, plain data out; no I/O, no async, no own threads.

mod batch;
pub mod cage;
pub mod coordinates;
pub mod decode;
pub mod inversion;
mod morton;
pub mod numbers;
pub mod regularize;
mod simd;
pub mod spectral;
pub mod sted;

/// Version of the preparation: stored solvers of another version are recomputed. Decoding a
/// container depends on [`coordinates::DEFINITION`] alone.
pub const SOLVER_VERSION: u32 = 9;

/// Compiles the examples of the README.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
