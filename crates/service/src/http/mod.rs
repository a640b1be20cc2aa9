//! HTTP: routes, what they take and give, and the listener.

mod admin;
mod audited;
mod cage;
mod cage_jobs;
mod cages;
mod capture_files;
mod container;
mod content_encoding;
mod coordinates;
mod decode;
mod decode_layer;
mod errors;
mod events;
mod exported;
mod extract;
mod form;
mod frame_parser;
mod frames;
#[cfg(feature = "fuzzing")]
pub mod fuzzing;
mod guarded;
mod health;
mod job_frames;
mod jobs;
pub mod listen;
mod metered;
mod methods;
mod multipart;
pub mod openapi;
mod origin;
mod other_model;
mod page;
mod progress;
mod ranged;
mod recoveries;
mod respond;
mod router;
mod sent;
mod sessions;
mod shape_spaces;
mod solved_frames;
mod spooled;
mod transfers;
mod waiting;

pub use admin::{admin, without_pages};
pub use router::{document, router, seen, seen_by_operators, spare};
