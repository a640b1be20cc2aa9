//! The `cager` program: the command line and the service over the crates that do the work.

mod admission;
pub mod auth;
pub mod belong;
#[doc(hidden)]
pub mod cage_job;
pub mod cages_out;
pub mod capture;
pub mod cli;
mod compare;
pub mod config;
mod coordinates;
pub mod decode;
pub mod design;
pub mod edit;
pub mod edited;
pub mod encode;
pub mod engine;
pub mod frames;
pub mod http;
mod idempotency;
pub mod memory;
mod outgoing;
mod picture;
mod plot;
pub mod problem;
pub mod remote;
pub mod service;
mod session;
mod speed;
pub mod store;
pub mod telemetry;
pub mod timing;
mod unread;
pub mod webhooks;
