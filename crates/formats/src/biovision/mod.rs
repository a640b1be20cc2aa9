//! Skeletons and their motion in Biovision's BVH files: read, posed, written.
//!
//! A file is a tree of joints, each with an offset from its parent and a list of channels, and one
//! row of channel values for each frame. Angles are degrees; a joint's rotation is the product of
//! those of its channels in the order of the file. Lengths are in the unit of the file.

mod parser;
mod skeleton;
mod write;

pub use skeleton::{Channel, Clip, Joint, Motion, Skeleton};
pub use write::{bvh_bytes, write_bvh};

use crate::error::{Error, Fault};
use crate::signature::Signature;
use std::path::Path;

/// Reads a BVH file.
///
/// # Errors
/// See [`Error`]; its message names the line.
pub fn read_bvh(path: impl AsRef<Path>) -> Result<Clip, Error> {
    let path = path.as_ref();
    let bytes = std::fs::read(path).map_err(|cause| Error::read(path, cause))?;
    read_bvh_bytes(path, &bytes)
}

/// As [`read_bvh`], of bytes; `name` stands for the file in messages.
///
/// # Errors
/// As [`read_bvh`].
pub fn read_bvh_bytes(name: &Path, bytes: &[u8]) -> Result<Clip, Error> {
    let other = |fault| Signature::other_than("bvh", bytes).map_or(fault, Fault::damaged);
    parser::read(bytes).map_err(|fault| other(fault).at(name))
}
