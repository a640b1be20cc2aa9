//! Cages: generated around a model, checked, repaired, and designed from its motion. No files.

mod bounding_shape;
mod components;
mod design;
pub mod diagnosis;
mod enclose;
mod enclose_apart;
mod thinned;

pub use bounding_shape::{BoundingShape, bounding_shape};
pub use components::Components;
pub use design::{
    Design, DesignError, DesignOptions, Goal, MAX_VERTICES, Parts, Progress, Rates, Stage, Style, SuitedSize, Unseen,
    design,
};
pub use enclose::{EncloseError, EncloseOptions, enclose, enclose_watched};
pub use enclose_apart::enclose_apart;

/// Compiles the examples of the README.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
