//! Meshes, point caches, skeletons in motion and sparse matrices to and from files and byte slices.
//!
//! Readers take bytes of any origin: they return an error for whatever they do not understand,
//! never panic, and never allocate more than a small multiple of what the file holds (and 512 MiB
//! for copies that glTF and FBX make). Writers make files that appear whole or not at all.

mod alembic;
pub mod atomic;
pub mod biovision;
mod colors;
mod dropped;
mod error;
mod faces;
mod fbx;
pub mod frames;
mod glb;
mod listing;
mod matrix;
pub mod mesh;
mod names;
mod natural;
mod normals;
mod pictures;
mod scene;
mod signature;
mod text;
mod usd;
mod vat;

pub use atomic::{AtomicDir, AtomicFile, ScratchDir, Target, commit_together, remove_temporaries};
pub use cager_geometry::units::{Units, Up};
pub use dropped::Dropped;
pub use error::{Action, Error};
pub use frames::{
    CacheFormat, CageMesh, FrameOptions, FrameRange, FrameReader, FrameSelection, FrameWriter, MeshSequence,
    MorphOptions, PictureSequence, RATES, create_frames, frame_files, frame_numbers, frames_path, is_numbered_in_vain,
    mesh_sequence, missing_frames, names_beside_others, open_frames, open_frames_bytes, open_frames_in,
    open_raw_frames, open_selected_frames,
};
pub use listing::{FORMATS, Listed};
pub use matrix::{read_matrix, read_matrix_bytes};
pub use mesh::{
    MeshFormat, ReadModel, model_bytes, obj_bytes, read_mesh, read_mesh_bytes, read_model, read_model_bytes,
    read_split_mesh, read_split_mesh_bytes, write_model,
};
pub use pictures::take_pictures;
pub use scene::chosen_parts;
pub use signature::Signature;

/// Compiles the examples of the README.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
