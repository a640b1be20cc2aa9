//! Pictures of models and cages: a small rasteriser that writes PNG.

mod camera;
mod canvas;
mod colour;
mod png;
mod scene;

pub(crate) use camera::{Camera, Up};
pub(crate) use colour::{Ramp, diverging, diverging_css};
pub(crate) use png::Png;
pub(crate) use scene::{Mesh, Scene, Shade};
