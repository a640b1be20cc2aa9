//! The `cager` program: the command line over the crates that do the work.

pub mod cli;
pub mod remote;
