//! What holds when things go wrong: processes killed, disks that refuse, clients that misbehave, more work than there is room for.

#![cfg(target_os = "linux")]
#![allow(clippy::print_stdout, reason = "figures and seeds, shown where somebody asks for them")]

mod capture;
mod client_gone;
mod completion;
#[path = "../database/mod.rs"]
mod database;
mod disk;
mod faults;
mod gate;
mod inside;
mod limits;
mod neighbours;
mod overload;
mod power;
mod process;
mod races;
mod shares;
mod soak;
mod stalled;
mod strangers;
mod wire;
