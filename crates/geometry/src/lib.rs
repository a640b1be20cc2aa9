//! Meshes, their topology, spatial queries and dense linear algebra: plain data in, plain data out.
//! All results are independent of the number of threads.

pub mod linalg;
pub mod mesh;
pub mod spatial;
pub mod surface;
pub mod topology;
pub mod units;
pub mod vector;

/// Compiles the examples of the README.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
