//! Inversion of frames: a [`Solver`] is prepared once for a rest pose and its cage and then takes one matrix product per batch of frames, followed by
//! Gauss–Newton steps where normals are functions of the vertices.

mod analysed_coordinates;
mod analysis;
mod checks;
mod consistent;
mod context;
mod error;
mod factored;
mod handle_system;
mod least_squares;
mod nearness;
mod operator;
mod options;
mod parts;
mod prepare;
mod solve;
mod spectra;
mod target;
mod threshold;
mod translations;

pub use crate::batch::BATCH;
pub use crate::handles::Handles;
pub use analysis::Analysis;
pub use checks::{check_options, coordinates_bytes, reject_far_points};
pub use consistent::{Convergence, Outcome};
pub use context::{PreparationReport, PrepareContext, Step};
pub use error::PrepareError;
pub use factored::{FactoredInversion, ProjectedFrames};
pub use handle_system::HandleSystem;
pub use nearness::NearnessParts;
pub use options::{SolverOptions, default_spectrum};
pub use parts::{DependentParts, SolverParts};
pub use solve::{InvertedFrame, Rows, Solver};
pub use target::RegularizationTarget;
pub use threshold::Threshold;
