//! HTTP: routes, what they take and give, and the listener.

mod admin;
mod audited;
mod cage;
mod cage_jobs;
mod cages;
mod container;
mod content_encoding;
mod coordinates;
mod decode;
mod decode_layer;
mod errors;
mod events;
mod exported;
mod extract;
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
mod multipart;
pub mod openapi;
mod origin;
mod other_model;
mod paced;
mod page;
mod progress;
mod ranged;
mod recoveries;
mod respond;
mod router;
mod sent;
mod sessions;
mod shape_spaces;
mod spooled;
mod transfers;

pub use admin::{Operated, admin};
pub(crate) use guarded::until;
pub(crate) use health::{health, may_see_metrics, rendered_metrics};
pub(crate) use router::finished;
pub use router::{document, router, seen, seen_by_operators, spare};
