//! The mathematics of CageR: plain data in, plain data out; no I/O, no async, no threads of its own making.

pub mod cage;
pub mod coordinates;
pub mod decode;
mod dense;
pub mod handles;
pub mod inversion;
pub mod maxvol;
pub mod mesh;
pub mod regularize;
mod simd;
mod spectrum;
pub mod svd;
pub mod synthetic;

/// Version of the computation of solvers: one that was stored by another version is computed anew. What a container needs to be decoded
/// is [`coordinates::DEFINITION`] alone.
pub const SOLVER_VERSION: u32 = 4;
