//! The solver: prepared once for a rest pose and its cage, then one matrix product per batch of frames.

mod error;
mod operator;
mod options;
mod parts;
mod prepare;
mod solve;

pub use error::PrepareError;
pub use options::{Handles, SolverOptions};
pub use parts::SolverParts;
pub use prepare::{Preparation, coordinates_fit};
pub use solve::{BATCH, Solver};

pub(crate) use operator::tall_product;
pub(crate) use solve::product_columns;

/// Rows of one block where a tall matrix is multiplied in blocks.
const BLOCK_ROWS: usize = 1024;
