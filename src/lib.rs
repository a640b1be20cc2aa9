//! The `cager` program: the command line over the crates that do the work.

pub mod capture;
pub mod cli;
mod coordinates;
pub mod decode;
pub mod encode;
pub mod engine;
mod plot;
pub mod report;
pub mod store;
