//! The `cager` program: the command line and the service over the crates that do the work.

pub mod auth;
pub mod cli;
pub mod config;
mod coordinates;
pub mod decode;
pub mod encode;
pub mod http;
mod plot;
pub mod report;
pub mod telemetry;
