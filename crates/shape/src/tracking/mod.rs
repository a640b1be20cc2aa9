//! A template followed by its cage through a sequence of surfaces, and where the topology of these changed.

mod change;
mod offsets;
mod track;

pub use change::changed_for_good;
pub use offsets::OffsetSolver;
pub use track::{Outcome, SecondPass, TrackedFrame, Tracker, smoothed};
