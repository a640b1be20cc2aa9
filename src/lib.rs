//! The `cager` program: the command line and the service over the crates that do the work.

mod admission;
mod audit;
pub mod auth;
#[doc(hidden)]
pub mod cage_job;
pub mod cli;
mod compare;
pub mod config;
pub mod engine;
mod file_bodies;
pub mod http;
mod http_client;
mod idempotency;
mod jobs;
mod pose_cage;
mod pose_faces;
mod preparation;
pub mod problem;
pub mod recover;
mod recovery;
pub mod remote;
mod report_page;
mod resources;
pub mod service;
mod session;
mod shape_spaces;
mod shards;
pub mod store;
mod sync;
mod tasks;
pub mod telemetry;
pub mod transfer;
mod transfers;
pub mod webhooks;

pub use cager_capture::{
    belonging, cage_export, capture, coding, decode, design, edit, edited, encode, frames, memory, mismatch, timing,
};
use cager_capture::{origin, preparation_warnings, speed};
