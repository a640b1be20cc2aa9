//! The `.cager` container, version 1: rest pose, cage, options, one cage per frame and its errors, in one file.
//!
//! `docs/FORMAT.md` specifies the bytes.

mod codec;
mod error;
mod reader;
mod section;
mod writer;

pub use error::Error;
pub use reader::{ContainerReader, FrameError, SectionInfo};
pub use writer::ContainerWriter;

use serde::{Deserialize, Deserializer, Serialize};

/// First bytes of every container. Like PNG's they show damage by text-mode transfers.
pub const MAGIC: [u8; 8] = *b"\x89CGR\r\n\x1a\n";
/// Version of the layout.
pub const VERSION: u16 = 1;
/// Largest encoded [`Header`], in bytes.
pub(crate) const HEADER_LIMIT: usize = 64 << 10;
/// Frames of one chunk: what reading one frame decompresses.
pub const CHUNK_FRAMES: usize = 16;

/// What a decoder must know. Stored as bincode of fixed-width integers, see [`crate::wire`].
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
}

/// What the encoder found out, for people and reports; a decoder does not need it. Stored as JSON.
#[derive(Clone, Debug, Default, Deserialize, PartialEq, Serialize)]
#[serde(default)]
pub struct Summary {
    /// Program and version that wrote the file.
    pub generator: String,
    /// Triangles of the model.
    pub triangles: u64,
    /// `max_i |Φ C_R − P_R|_i` over the rest diagonal.
    #[serde(deserialize_with = "number_or_null")]
    pub affine_reproduction_error: f64,
    /// Condition numbers.
    pub condition_number: ConditionNumber,
    /// Numerical rank of `Φ`.
    pub rank: u64,
    /// Singular values of the inverted matrix, descending.
    pub singular_values: Vec<f64>,
    /// How the handles of maximum volume were found.
    pub maxvol: MaxVolSummary,
    /// Rows read, in their order: those of maximum volume first. Where every point is read, only those.
    pub handle_indices: Vec<u32>,
    /// Errors of the capture over the rest diagonal.
    pub error: ErrorSummary,
    /// f32 positions of all frames and one connectivity.
    pub capture_bytes: u64,
    /// What a user should know.
    pub warnings: Vec<String>,
}

/// Condition numbers over the numerical rank.
#[derive(Clone, Copy, Debug, Default, Deserialize, PartialEq, Serialize)]
#[serde(default)]
pub struct ConditionNumber {
    /// Of `Φ`.
    #[serde(deserialize_with = "number_or_null")]
    pub full: f64,
    /// Of the handles' rows.
    #[serde(deserialize_with = "number_or_null")]
    pub handles: f64,
}

/// How the handles were found.
#[derive(Clone, Copy, Debug, Default, Deserialize, PartialEq, Serialize)]
#[serde(default)]
pub struct MaxVolSummary {
    /// Swaps after the start by pivoted LU.
    pub swaps: u64,
    /// `ln |det Φ□|`.
    #[serde(deserialize_with = "number_or_null")]
    pub log_volume: f64,
    /// Largest `|B_ij|` at the end.
    #[serde(deserialize_with = "number_or_null")]
    pub max_entry: f64,
}

/// Errors of the capture over the rest diagonal.
#[derive(Clone, Copy, Debug, Default, Deserialize, PartialEq, Serialize)]
#[serde(default)]
pub struct ErrorSummary {
    /// Mean over frames of the L2 error.
    #[serde(deserialize_with = "number_or_null")]
    pub l2_mean: f64,
    /// Largest L2 error of a frame.
    #[serde(deserialize_with = "number_or_null")]
    pub l2_max: f64,
    /// Mean over frames of the L∞ error.
    #[serde(deserialize_with = "number_or_null")]
    pub linf_mean: f64,
    /// Largest L∞ error of a frame.
    #[serde(deserialize_with = "number_or_null")]
    pub linf_max: f64,
    /// `100 · ‖A − Â‖_F / ‖A − E(A)‖_F`.
    #[serde(deserialize_with = "number_or_null")]
    pub kg_percent: f64,
}

/// JSON has no infinity and no NaN, and serde_json writes null for them: a capture that stands still has such figures, and
/// its file must open.
fn number_or_null<'de, D: Deserializer<'de>>(deserializer: D) -> Result<f64, D::Error> {
    Ok(Option::deserialize(deserializer)?.unwrap_or(f64::NAN))
}

/// Numbers of frames are finite and ascend.
pub(crate) fn are_frame_numbers(numbers: &[f64]) -> bool {
    numbers.iter().all(|x| x.is_finite()) && numbers.windows(2).all(|pair| pair[0] < pair[1])
}

/// The sections this program knows.
pub(crate) mod tag {
    pub(crate) const HEADER: [u8; 4] = *b"HEAD";
    pub(crate) const REST_POINTS: [u8; 4] = *b"RPTS";
    pub(crate) const REST_FACES: [u8; 4] = *b"RFAC";
    pub(crate) const CAGE_VERTICES: [u8; 4] = *b"CVTX";
    pub(crate) const CAGE_FACES: [u8; 4] = *b"CTRI";
    pub(crate) const ELEMENTS: [u8; 4] = *b"ELEM";
    pub(crate) const FRAMES: [u8; 4] = *b"FRAM";
    pub(crate) const ERRORS: [u8; 4] = *b"ERRS";
    pub(crate) const CONTENTS: [u8; 4] = *b"TOC_";
    pub(crate) const NUMBERS: [u8; 4] = *b"fnum";
    pub(crate) const SUMMARY: [u8; 4] = *b"summ";
    pub(crate) const KNOWN: [[u8; 4]; 11] = [
        HEADER,
        REST_POINTS,
        REST_FACES,
        CAGE_VERTICES,
        CAGE_FACES,
        ELEMENTS,
        FRAMES,
        ERRORS,
        CONTENTS,
        NUMBERS,
        SUMMARY,
    ];
}
