//! Client of the CageR encoding service: mesh captures in, cages out.
//!
//! A session belongs to one model in its rest pose and one cage. It prepares once; then frames are sent and their cages come
//! back while the upload runs. When all frames are there, the session is completed and its container can be downloaded.
//!
//! ```no_run
#![doc = include_str!("../examples/encode.rs")]
//! ```
//!
//! * [`Client`]: one address; every call of the service is a method.
//! * [`FrameSource`]: where frames come from; [`MemoryFrames`] and [`FnFrames`] are two.
//! * [`LocalDecoder`]: positions from cages on this machine.
//! * [`ClientError`]: what went wrong, by what a caller can do about it.
//!
//! Connections break and services restart: calls are tried again with growing pauses, uploads go on with the frames that are
//! missing, streams with the next frame, downloads with the next byte. [`ClientOptions`] says for how long.
//!
//! Every call runs on tokio. Numbers of frames count from 0; lengths are fractions of the rest pose's diagonal.

mod address;
mod backoff;
mod body;
mod cages;
#[cfg(test)]
mod chunks;
mod client;
mod create;
mod download;
mod error;
mod events;
mod follow;
mod jobs;
mod layers;
mod lines;
mod local;
mod options;
mod other_model;
mod problem;
mod records;
mod recoveries;
mod results;
mod sent;
mod sessions;
mod shape_spaces;
mod source;
mod sse;
mod transfers;
mod upload;

pub use cager_proto::{cage_messages, messages, recovery_messages, shape_messages, transfer_messages};
pub use cages::NewCage;
pub use client::Client;
pub use create::{MeshFile, NewSession};
pub use error::ClientError;
pub use layers::Layer;
pub use local::LocalDecoder;
pub use options::ClientOptions;
pub use other_model::MovedModel;
pub use records::CageFrame;
pub use recoveries::NewRecovery;
pub use results::Coordinates;
pub use source::{FnFrames, FrameSource, MemoryFrames};
pub use transfers::{NewTransfer, TransferSource};
pub use upload::{Rows, UploadOptions, Uploaded};

/// Compiles the examples of the README.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
