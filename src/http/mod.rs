//! HTTP: routes, what they take and give, and the listener.

mod cage;
mod cage_jobs;
mod cages;
mod container;
mod coordinates;
mod decode;
mod errors;
mod events;
mod extract;
mod frames;
mod frames_in;
#[doc(hidden)]
pub mod fuzzing;
mod health;
pub mod listen;
mod multipart;
pub mod openapi;
mod other_model;
mod progress;
mod ranged;
mod respond;
mod router;
mod sessions;
mod viewer;

pub use router::{document, router, spare};
