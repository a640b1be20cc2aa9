//! Diagnosis of a cage: all its defects at once, and repair of those that can be repaired without changing its intent.

mod enlarge;
mod findings;
mod fit;
mod holes;
mod influence;
mod messages;
mod repair;
mod weld;

pub use findings::{Alignment, Findings, Outside, check};
pub use fit::alignment;
pub use repair::{Repair, repair};
pub use weld::{Welded, weld};
