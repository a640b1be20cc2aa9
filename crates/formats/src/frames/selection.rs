//! Which of the files and frames of a source are taken.

use std::path::PathBuf;

use super::FrameRange;

/// What is taken of a source, where its path does not tell: everything by default.
#[derive(Clone, Debug, Default)]
pub struct FrameSelection {
    /// Only these frames.
    pub range: Option<FrameRange>,
    /// The rest pose, the cage: files that are left out where they lie among the frames, unless they are called as frames are.
    pub no_frames: Vec<PathBuf>,
    /// The mesh of a scene (Alembic, USD, glTF) that has several, by its path or name; the array of an `.npz` file, by its name.
    pub prim: Option<String>,
    /// The animation of a file of glTF that has several, by its name or its number from 0; the first one that moves the mesh by default.
    pub animation: Option<String>,
    /// Frames per second to take of an animation that has keys and no frames (glTF); those at the times of its keys by default.
    pub rate: Option<f64>,
    /// Whether files of several sequences are taken one after another, in natural order, instead of refused.
    pub join_sequences: bool,
}
