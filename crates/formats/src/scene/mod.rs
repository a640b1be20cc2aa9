//! What readers of scenes share, whatever the format: one mesh of several is chosen, transforms above it are applied, and its frames are read one by one.

mod choice;
mod faces;
mod failure;
mod matrix;
mod reader;

pub(crate) use choice::{Objects, choose, list, named, shown, shown_path};
pub(crate) use faces::{Faces, most_corners, topology_changes};
pub(crate) use failure::Failure;
pub(crate) use matrix::{IDENTITY, Matrix, between, determinant, inverse, multiply, rotation, rows_of, slerp};
pub(crate) use reader::{Animation, MOST_REPEATED, check_held, open, placed};
