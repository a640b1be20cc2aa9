//! The service that `cager serve` runs: what is asked over HTTP, the life of sessions and jobs, and what is stored of them.

mod admission;
mod audit;
pub mod auth;
#[doc(hidden)]
pub mod cage_job;
pub mod config;
mod descriptors;
pub mod engine;
mod file_bodies;
pub mod http;
mod http_client;
mod idempotency;
mod jobs;
pub mod local;
mod preparation;
pub mod problem;
mod readiness;
mod recovery;
mod resources;
pub mod serve;
pub mod service;
mod session;
mod shape_spaces;
pub mod store;
mod sync;
mod tasks;
pub mod telemetry;
mod transfers;
pub mod webhooks;
