//! The `cager` program: the command line and the service over the crates that do the work.

mod admission;
pub mod auth;
pub mod cage_export;
#[doc(hidden)]
pub mod cage_job;
pub mod capture;
pub mod cli;
pub mod coding;
mod compare;
pub mod config;
pub mod decode;
pub mod design;
pub mod edit;
pub mod edited;
pub mod encode;
pub mod engine;
pub mod frames;
pub mod http;
mod http_client;
mod idempotency;
pub mod memory;
pub mod mismatch;
mod preparation;
mod preparation_warnings;
pub mod problem;
pub mod remote;
mod report_page;
pub mod service;
mod session;
mod speed;
pub mod store;
mod sync;
mod tasks;
pub mod telemetry;
pub mod timing;
mod unreadable;
pub mod webhooks;
