//! FBX, binary and as text: the meshes of a scene as an animation moves them, with skins, blend
//! shapes and geometry caches applied; read only.
//!
//! The `ufbx` crate parses and evaluates scenes; here are the choice of meshes and frames, and what
//! lies on the faces. Positions keep the unit and the upward axis of the file.

#[cfg(not(feature = "fbx"))]
mod absent;
#[cfg(feature = "fbx")]
mod animation;
#[cfg(feature = "fbx")]
mod frames;
#[cfg(feature = "fbx")]
mod load;
#[cfg(feature = "fbx")]
mod material;
#[cfg(feature = "fbx")]
mod part;
#[cfg(feature = "fbx")]
mod tree;

#[cfg(not(feature = "fbx"))]
pub(crate) use absent::{open_frames, read};
#[cfg(feature = "fbx")]
pub(crate) use frames::{open_frames, read};
