//! Motions moved onto other models, and shapes between poses.

mod captures;
mod common;
mod errors;
mod identities;
mod pairs;
mod shapes;
