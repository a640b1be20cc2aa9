//! The `cager` program: the command line over the crates that do the work.

pub mod cli;
mod coordinates;
pub mod decode;
pub mod encode;
mod plot;
pub mod report;
pub mod store;
