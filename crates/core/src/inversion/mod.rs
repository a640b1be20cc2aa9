//! Inversion of frames: a [`Solver`] is prepared once for a rest pose and its cage and then takes
//! one matrix product per batch of frames, and Gauss–Newton steps where normals are dependent.

mod analysed_coordinates;
mod checks;
mod consistent;
mod context;
mod error;
mod least_squares;
mod nearness;
mod options;
mod parts;
mod prepare;
mod solve;
mod target;

pub use crate::batch::BATCH;
pub use checks::{check_options, coordinates_bytes, reject_carriers, reject_far_points};
pub use consistent::{Convergence, Outcome};
pub use context::{PreparationReport, PrepareContext, Step};
pub use error::PrepareError;
pub use nearness::NearnessParts;
pub use options::{Handles, SolverOptions, default_spectrum};
pub use parts::{DependentParts, SolverParts};
pub use solve::{InvertedFrame, Rows, Solver};
pub use target::RegularizationTarget;

pub(crate) use analysed_coordinates::AnalysedCoordinates;
pub(crate) use checks::about_first;
pub(crate) use consistent::Consistent;
pub(crate) use error::failed;
pub(crate) use nearness::Nearness;
pub(crate) use target::{with_unit_row_sums, with_zero_row_sums};
