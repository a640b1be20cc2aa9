//! Diagnosis of a cage: all its defects at once, and repair without changing its intent.

mod alignment;
mod apart;
mod enlarge;
mod findings;
mod holes;
mod influence;
mod messages;
mod repair;
mod weld;

pub use alignment::{Alignment, alignment};
pub use findings::{Findings, Outside, check};
pub use repair::{Repair, repair};
pub use weld::{Welded, weld};
