//! A template followed through surfaces by its cage, and where their topology changed.

mod change;
mod offsets;
mod track;

pub use change::changed_for_good;
pub use offsets::OffsetSolver;
pub use track::{Outcome, SecondPass, TrackedFrame, Tracker, smoothed};
