//! Which of the files and frames of a source are taken.

use std::path::PathBuf;
use std::sync::Arc;

use cager_geometry::mesh::Model;

use super::FrameRange;

/// What is taken of a source, where its path does not tell: everything by default.
#[derive(Clone, Debug, Default)]
pub struct FrameSelection {
    /// Only these frames.
    pub range: Option<FrameRange>,
    /// The rest pose, the cage: files that are no frames, unless they are called as frames are.
    pub no_frames: Vec<PathBuf>,
    /// Meshes of a scene that has several, by paths, names or globs of these, all where there are
    /// none; the array of an `.npz` file, the cache of a Maya file.
    pub prims: Vec<String>,
    /// The animation of glTF and FBX, by its name or number; by default the first that moves the mesh.
    pub animation: Option<String>,
    /// Frames per second to take of glTF and FBX; by default frames are at the times of the keys of
    /// glTF and at the rate of FBX.
    pub rate: Option<f64>,
    /// The rest pose, of whose parts files of a frame each may lack some.
    pub rest: Option<Arc<Model>>,
    /// Whether files of several sequences are taken in natural order, instead of refused.
    pub join_sequences: bool,
}

impl FrameSelection {
    /// The one name, for files whose arrays are not put together.
    pub(super) fn prim(&self) -> Option<&str> {
        self.prims.first().map(String::as_str)
    }
}
