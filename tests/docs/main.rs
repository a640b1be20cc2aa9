//! Documents and deployment files against the program: what they say is run or looked up.

mod clients;
mod commands;
mod deploy;
mod format;
mod operations;
mod support;
#[cfg(target_os = "linux")]
mod walled;

// Run by `clients`, in a process of its own.
#[path = "../../crates/client/examples/encode.rs"]
mod encode_example;
