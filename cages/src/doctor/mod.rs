//! The cage doctor: what is wrong with a cage, all at once, and repair of what can be repaired without changing what it was made for.

mod connectivity;
mod enlarge;
mod findings;
mod fit;
mod holes;
mod influence;
mod repair;
mod sentences;
mod weld;

pub use findings::{Findings, Misfit, Outside, check};
pub use fit::misfit;
pub use repair::{Repair, repair};
pub use weld::{Welded, weld};
