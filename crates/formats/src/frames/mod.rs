//! The frames of captures, one after another, so that memory does not grow with their number.

mod block;
mod cache;
mod cut;
mod files;
mod fortran;
mod layout;
mod maya;
mod mdd;
mod merged;
mod names;
mod npy;
mod npz;
mod numbered;
mod numbers;
mod packed;
mod pc2;
mod pictures;
mod pieces;
mod python;
mod range;
mod selection;
mod sequence;
mod several;
mod single;
mod source;
mod times;
mod vanished;
mod widen;
mod write;

use std::ops::Range;
use std::path::Path;

use cager_geometry::mesh::Polygons;
use cager_geometry::surface::Channel;
use cager_geometry::units::Units;

use crate::error::Error;

pub(crate) use block::read_values;
pub use numbers::missing_frames;
pub(crate) use pictures::named_in;
pub use range::FrameRange;
pub use selection::FrameSelection;
pub use source::{
    MeshSequence, frame_files, frame_numbers, mesh_sequence, open_frames, open_frames_bytes, open_frames_in,
    open_raw_frames, open_selected_frames,
};
pub(crate) use times::{Times, nominal};
pub(crate) use widen::{Scalar, half_precision};
pub use write::{
    CageMesh, FrameOptions, FrameWriter, MorphOptions, create_frames, frames_path, is_numbered_in_vain,
    names_beside_others,
};

/// Frames per second that files hold: beyond, times are infinite, or frames no longer apart.
pub const RATES: std::ops::RangeInclusive<f64> = 1e-3..=1e6;

/// What a material has of a channel in each frame.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PictureSequence {
    /// The name of the material.
    pub material: String,
    /// Its place among the materials of a model that is read from the same file, where names of
    /// several can be equal.
    pub place: Option<usize>,
    /// What the pictures are for.
    pub channel: Channel,
    /// One for each frame.
    pub paths: Vec<String>,
}

/// Positions of one capture, frame by frame; memory does not grow with the number of frames.
pub trait FrameReader: Send {
    /// Number of points of every frame.
    fn points(&self) -> usize;

    /// Number of frames, known before any is read.
    fn frames(&self) -> usize;

    /// Frames per second, where the source tells.
    fn frame_rate(&self) -> Option<f64> {
        None
    }

    /// The number that the source gives to a frame, counted from 0. Numbers ascend.
    fn number(&self, frame: usize) -> f64 {
        frame as f64
    }

    /// Whether [`Self::number`] tells times, so that what lies between two numbers is not missing.
    fn numbers_are_times(&self) -> bool {
        false
    }

    /// What the user should know of how the source is read.
    fn notes(&self) -> Vec<String> {
        Vec::new()
    }

    /// What the coordinates mean, as far as the source says; they are given as they are stored.
    fn units(&self) -> Units {
        Units::UNKNOWN
    }

    /// Frames in which each part of the mesh is shown, counted from 0; `None` for a part that always
    /// is, and nothing where no part is ever hidden, or the source does not say.
    fn shown(&self) -> Vec<Option<Vec<Range<u32>>>> {
        Vec::new()
    }

    /// Pictures of materials that are not the same in all frames; nothing where the source does not
    /// say. Names of files in a folder begin with that.
    fn pictures(&self) -> Vec<PictureSequence> {
        Vec::new()
    }

    /// The file that the last frame was read from and the faces in it, where it has any.
    fn mesh(&self) -> Option<(&Path, &Polygons)> {
        None
    }

    /// Reads the next frame into `out`, which then holds 3 × points coordinates `x y z x y z …`;
    /// false at the end, with `out` empty.
    ///
    /// # Errors
    /// [`Error::NonFinite`] and those of the format; the next call tries the same frame again.
    fn read_next(&mut self, out: &mut Vec<f64>) -> Result<bool, Error>;

    /// Skips the next frame, without checking it where that avoids reading it; false at the end.
    ///
    /// # Errors
    /// As [`Self::read_next`].
    fn skip(&mut self) -> Result<bool, Error> {
        self.read_next(&mut Vec::new())
    }
}

/// A file format for the frames of a capture.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum CacheFormat {
    /// A NumPy array, frames × points × 3; other orders of its axes are read as well.
    Npy,
    /// Point cache 2, as 3ds Max and Blender write it.
    Pc2,
    /// Motion Designer point cache of LightWave.
    Mdd,
    /// Geometry cache of Maya, with a text beside it.
    Mcx,
    /// The same with sizes of 32 bits.
    Mc,
    /// Alembic in the Ogawa container: one polygon mesh, with the transforms above it.
    Abc,
    /// Universal Scene Description in binary: one polygon mesh, with the transforms above it.
    Usdc,
    /// The same as a package: a zip archive whose first file it is.
    Usdz,
    /// The same as text; not written.
    Usda,
    /// Universal Scene Description of any kind; written in binary.
    Usd,
    /// Binary glTF 2.0: its meshes as an animation moves them.
    Glb,
    /// The same as text, with its data in it or in files beside it.
    Gltf,
    /// FBX: its meshes as an animation moves them; not written.
    Fbx,
}

impl CacheFormat {
    /// All formats.
    pub const ALL: [Self; 13] = {
        use CacheFormat::*;
        [Npy, Pc2, Mdd, Mcx, Mc, Abc, Usdc, Usdz, Usda, Usd, Glb, Gltf, Fbx]
    };

    /// Whether a file has a whole scene of several meshes; a `.glb` is taken as one mesh.
    pub fn is_scene(self) -> bool {
        matches!(self, Self::Abc | Self::Usdc | Self::Usdz | Self::Usda | Self::Usd | Self::Gltf | Self::Fbx)
    }

    /// The file name extension, without the dot.
    pub fn extension(self) -> &'static str {
        ["npy", "pc2", "mdd", "mcx", "mc", "abc", "usdc", "usdz", "usda", "usd", "glb", "gltf", "fbx"][self as usize]
    }

    /// The format that the path's extension names, if any.
    pub fn from_path(path: &Path) -> Option<Self> {
        let found = path.extension()?;
        Self::ALL.into_iter().find(|format| found.eq_ignore_ascii_case(format.extension()))
    }
}
