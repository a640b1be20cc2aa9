//! Encoding by a service, from the client's side: the program and the client crate against a service of its own.

mod client;
mod command;
mod far_away;
mod gone_on;
mod limited;
mod restart;
mod server;
// Not all of it is of use here.
#[allow(dead_code)]
#[path = "../cli/support.rs"]
mod support;
