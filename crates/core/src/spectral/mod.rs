//! Inversion by the singular directions of chosen rows (Thiery, Tierny and Boubekeur 2012): what
//! `--handles`, thresholds and the paper's baselines need beside least squares over all points.

mod analysis;
mod decomposition;
mod farthest;
mod handle_system;
mod interpolation;
pub mod maxvol;
mod normal_factor;
mod rectangular;
mod row_basis;
mod terms;
mod threshold;

pub use analysis::Analysis;
pub use handle_system::HandleSystem;
pub use threshold::Threshold;
