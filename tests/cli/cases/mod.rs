//! Inputs of `tests/cases`, made after files that people had trouble with: each does what a user would expect, and so do variants of it.

mod belonging;
mod cages;
mod designed;
mod dropped;
mod frame_names;
mod gltf;
mod meshes;
mod mirrored;
mod numbers;
mod numpy;
mod one_file_each;
mod origin;
mod parts;
mod pictures;
mod pointers;
mod surface;
mod turns;
mod words;
