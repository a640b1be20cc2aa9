//! The solver: prepared once for a rest pose and its cage, then one matrix product per batch of frames; where normals follow from
//! vertices, that is the start of an iteration.

mod analysis;
mod consistent;
mod coordinates;
mod error;
mod factored;
mod operator;
mod options;
mod parts;
mod prepare;
mod pull;
mod reading;
mod solve;
mod threshold;
mod translations;

pub use crate::handles::Handles;
pub use analysis::Analysis;
pub use consistent::{Convergence, Outcome};
pub use error::PrepareError;
pub use factored::{Factored, Projected};
pub use options::{SolverOptions, usual_spectrum};
pub use parts::{SolverParts, TiedParts};
pub use prepare::{Preparation, Preparing, check_options, coordinates_fit, refuse_far_points};
pub use pull::Pull;
pub use reading::Reading;
pub use solve::{BATCH, Inverted, Solver};
pub use threshold::Threshold;

pub(crate) use operator::tall_product;
pub(crate) use solve::product_columns;

/// Rows of one block where a tall matrix is multiplied in blocks.
const BLOCK_ROWS: usize = 1024;
