//! The service over HTTP.

pub mod listen;
