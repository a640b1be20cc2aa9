//! The `.cager` container, version 1: rest pose, cage, options, one cage per frame and its errors.
//!
//! `docs/FORMAT.md` specifies the bytes.

mod codec;
mod coded;
mod components;
mod contents;
mod edits;
mod error;
mod frames;
mod groups;
mod layers;
mod model;
mod packed;
mod pictures;
mod reader;
mod rewrite;
mod section;
mod surface;
mod units;
mod writer;

pub use coded::most_residual_numbers;
pub use edits::{EditLayer, LayerBuilder, MAX_LAYER_NAME, MAX_LAYERS};
pub use error::Error;
pub use packed::{pack_model, unpack_model};
pub use reader::{ContainerReader, SectionInfo};
pub use rewrite::LayerSource;
pub use writer::{ContainerWriter, colors_bytes};

use cager_geometry::mesh::Point;
use cager_geometry::units::Units;
use serde::{Deserialize, Serialize};

/// First bytes of every container. Like PNG's they show damage by text-mode transfers.
pub const MAGIC: [u8; 8] = *b"\x89CGR\r\n\x1a\n";
/// Version of the layout.
pub const VERSION: u16 = 1;
/// Largest encoded [`Header`], in bytes.
pub(crate) const MAX_HEADER_BYTES: usize = 64 << 10;
/// Frames of one chunk: what reading one frame decompresses.
pub const CHUNK_FRAMES: usize = 16;

/// Most frames of a coded group: more take fewer bytes, but reading one decodes them all.
const MAX_GROUP_FRAMES: usize = 256;

/// Frames of a coded group of so many points and rows, so that readers need little memory.
pub fn group_frames(points: usize, rows: usize) -> usize {
    let fitting = (cager_codec::MAX_POSITIONS / points.max(1)).min((2 << 20) / (12 * rows.max(1)));
    fitting.clamp(1, MAX_GROUP_FRAMES)
}

/// What a decoder must know, stored by [`crate::wire`] but for the origin and the units.
#[derive(Clone, Debug, Default, Deserialize, PartialEq, Serialize)]
pub struct Header {
    /// Definition of the coordinate systems by which decoders compute `Φ` anew.
    pub coordinates_definition: u32,
    /// Coordinate system: `mvc`, `harmonic`, `green` or `green-free`.
    pub coordinates: String,
    /// Points the inversion read: `maxvol`, `spread` or `all`.
    pub handles: String,
    /// Treatment of the unstable end of the spectrum.
    pub regularizer: String,
    /// Spectrum threshold s.
    pub spectrum: u32,
    /// Weight λ.
    pub lambda: f64,
    /// Points of the model.
    pub points: u64,
    /// Polygons of the model.
    pub rest_faces: u64,
    /// Corners of all those polygons.
    pub rest_corners: u64,
    /// Vertices of the cage.
    pub cage_vertices: u64,
    /// Triangles of the cage.
    pub cage_faces: u64,
    /// Rows of three coordinates stored per frame: the unknowns of the coordinate system.
    pub rows_per_frame: u32,
    /// Frames per second, where known.
    pub frame_rate: Option<f64>,
    /// What is added to all positions of a capture that lies far away; in a section of its own.
    #[serde(skip)]
    pub origin: Option<Point>,
    /// What positions mean, as far as the input said; stored in a section of its own.
    #[serde(skip)]
    pub units: Units,
}

impl Header {
    /// Bytes of so many frames in single precision with one connectivity, for comparison.
    pub fn capture_bytes(&self, frames: usize) -> u64 {
        let positions = self.points.saturating_mul(12).saturating_mul(frames as u64);
        self.rest_corners.saturating_mul(4).saturating_add(positions)
    }
}

/// Whether numbers are 0, 1, 2, …, as they are where nobody says otherwise.
pub fn counted_from_zero(numbers: &[f64]) -> bool {
    numbers.iter().enumerate().all(|(frame, &number)| number == frame as f64)
}

/// Whether all are finite and ascend, as numbers of frames must.
pub(crate) fn are_frame_numbers(numbers: &[f64]) -> bool {
    numbers.iter().all(|x| x.is_finite()) && numbers.windows(2).all(|pair| pair[0] < pair[1])
}

/// The sections this program knows.
pub(crate) mod tag {
    macro_rules! tags {
        ($($name:ident = $tag:literal;)*) => {
            $(pub(crate) const $name: [u8; 4] = *$tag;)*
            pub(crate) const KNOWN: &[[u8; 4]] = &[$($name),*];
        };
    }

    tags! {
        HEADER = b"HEAD";
        ORIGIN = b"ORIG";
        UNITS = b"unit";
        REST_POINTS = b"RPTS";
        REST_FACES = b"RFAC";
        REST_COLORS = b"rcol";
        SURFACE = b"surf";
        PICTURES = b"pict";
        CAGE_VERTICES = b"CVTX";
        CAGE_FACES = b"CTRI";
        COMPONENTS = b"COMP";
        ELEMENTS = b"ELEM";
        FRAMES = b"FRAM";
        ERRORS = b"ERRS";
        CONTENTS = b"TOC_";
        NUMBERS = b"fnum";
        REPORT = b"summ";
        RESIDUAL = b"resi";
        EDIT = b"EDIT";
    }
}
