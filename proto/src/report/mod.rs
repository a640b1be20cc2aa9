//! The report of an encoding, as `cager encode` writes it, a container keeps it, and `cager
//! inspect` shows it.
//!
//! Errors are fractions of the rest pose's bounding-box diagonal, times are seconds.

mod errors;
mod preparation;

pub use errors::{Errors, FrameError, WorstError};
pub use preparation::{Consistency, DesignReport, SpectrumChoice, StageReport, TriedSpectrum};

use crate::container::Header;
use cager_core::coordinates::Refinement;
use cager_core::numbers::number_or_null;
use cager_core::spectral::maxvol::Volume;
use cager_geometry::units::Units;
use serde::{Deserialize, Deserializer, Serialize};
use utoipa::ToSchema;

/// The content of a file with a report of any kind: JSON that people read as well.
///
/// # Errors
/// It cannot be written as JSON.
pub fn json_file(report: &impl Serialize) -> serde_json::Result<Vec<u8>> {
    let mut text = serde_json::to_vec_pretty(report)?;
    text.push(b'\n');
    Ok(text)
}

/// The report of one encoding. Keys that are missing read as zero or empty.
#[derive(Clone, Debug, Default, Deserialize, PartialEq, Serialize)]
#[serde(default)]
pub struct Report {
    /// Program and version that wrote the container.
    #[serde(skip_serializing_if = "String::is_empty")]
    pub generator: String,
    /// Points of the model, n.
    pub points: usize,
    /// Triangles of the model; 0 for a point cloud.
    pub triangles: usize,
    /// Frames of the capture.
    pub frames: usize,
    /// Frames per second, where known.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub frame_rate: Option<f64>,
    /// Diagonal of the rest pose's bounding box, in its unit: what errors are fractions of.
    pub diagonal: f64,
    /// What is added to all positions of a capture that lies far from the origin.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub origin: Option<[f64; 3]>,
    /// The length of 1 in metres, where it is known.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub metres_per_unit: Option<f64>,
    /// The axis that points up, `y` or `z`, where it is known.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub up: Option<String>,
    /// The number of each frame where it comes from; absent where they are 0, 1, 2, …
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub frame_numbers: Vec<f64>,
    /// Unknowns per frame, m.
    pub unknowns: usize,
    /// Vertices of the cage.
    pub cage_vertices: usize,
    /// Triangles of the cage.
    pub cage_faces: usize,
    /// Coordinate system.
    pub coordinates: String,
    /// Points the inversion read.
    pub handles: String,
    /// Treatment of the unstable end of the spectrum.
    pub regularizer: String,
    /// Spectrum threshold s.
    pub spectrum: usize,
    /// Why this threshold, where it was chosen by measuring.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub spectrum_choice: Option<SpectrumChoice>,
    /// Weight λ.
    pub lambda: f64,
    /// How the cage was designed, where none was given.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub design: Option<DesignReport>,
    /// How the iteration went, for coordinates whose inversion is one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub consistency: Option<Consistency>,
    /// How the coordinates were refined, where they are a numerical solution.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub refinement: Option<Refinement>,
    /// `max_i |Φ C_R − P_R|_i`.
    #[serde(deserialize_with = "number_or_null")]
    pub affine_reproduction_error: f64,
    /// Condition numbers over the numerical rank.
    pub condition_number: ConditionNumber,
    /// Numerical rank of `Φ`.
    pub rank: usize,
    /// Singular values of the inverted matrix, descending; NaN (`null`) where not computed: from
    /// 1,024 unknowns on, of which few are regularised, only the first and last are, and containers
    /// have none.
    #[serde(deserialize_with = "numbers_or_null", skip_serializing_if = "Vec::is_empty")]
    pub singular_values: Vec<f64>,
    /// How the handles of maximum volume were found.
    pub maxvol: Volume,
    /// Rows read in their order, those of maximum volume first or, of all points, alone.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub handle_indices: Vec<u32>,
    /// Errors of what a decoder of the written file gets back.
    pub error: Errors,
    /// How frames were coded, where an error, a size or a quality was asked for.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub coding: Option<Coding>,
    /// Sizes.
    pub bytes: Bytes,
    /// Times, which overlap, so that `total` is less than the sum. Absent where all are zero.
    #[serde(skip_serializing_if = "Seconds::are_zero")]
    pub seconds: Seconds,
    /// What a user should know but that did not stop the work.
    pub warnings: Vec<String>,
}

impl Report {
    /// What the header of a container says.
    pub fn new(header: &Header) -> Self {
        let mut report = Self::default();
        report.set_header(header);
        report
    }

    pub(crate) fn set_header(&mut self, header: &Header) {
        self.points = header.points as usize;
        self.frame_rate = header.frame_rate;
        self.origin = header.origin;
        self.set_units(header.units);
        self.unknowns = header.rows_per_frame as usize;
        self.cage_vertices = header.cage_vertices as usize;
        self.cage_faces = header.cage_faces as usize;
        self.coordinates.clone_from(&header.coordinates);
        self.handles.clone_from(&header.handles);
        self.regularizer.clone_from(&header.regularizer);
        self.spectrum = header.spectrum as usize;
        self.lambda = header.lambda;
    }

    /// Says what positions mean.
    pub fn set_units(&mut self, units: Units) {
        self.metres_per_unit = units.metres_per_unit;
        self.up = units.up.map(|up| up.name().to_owned());
    }

    /// Sets the bytes of the written file, once frames and the size of the capture are known.
    pub fn set_output(&mut self, output: u64) {
        let bytes = &mut self.bytes;
        bytes.output = output;
        bytes.ratio = bytes.capture as f64 / output as f64;
        bytes.bits_per_vertex_per_frame = 8.0 * output as f64 / (self.points * self.frames) as f64;
    }

    /// What a container stores: what its other sections do not say and no run changes.
    pub(crate) fn stored(&self) -> serde_json::Result<Vec<u8>> {
        const ELSEWHERE: &str = "points frames frame_rate diagonal origin metres_per_unit up frame_numbers unknowns \
            cage_vertices cage_faces coordinates handles regularizer spectrum lambda bytes seconds";
        let mut value = serde_json::to_value(self)?;
        if let Some(report) = value.as_object_mut() {
            report.retain(|key, _| !ELSEWHERE.split(' ').any(|elsewhere| key == elsewhere));
            // Large beside coded frames, and of little use without the cage that they were found
            // for. Earlier programs read singular values that are numbers alone.
            if self.coding.is_some() || self.singular_values.iter().any(|x| x.is_nan()) {
                report.remove("singular_values");
            }
            if self.coding.is_some() {
                report.remove("handle_indices");
            }
        }
        if let Some(error) = value["error"].as_object_mut() {
            error.retain(|key, _| key != "worst" && key != "per_frame");
        }
        serde_json::to_vec(&value)
    }

    /// Files round errors up: what passes a guaranteed error by that alone is that error.
    pub fn hold_errors_to_bound(&mut self) {
        const ROUNDED: f64 = 1.0 + 1.0 / 1024.0;
        let Some(bound) = self.coding.and_then(|coding| coding.max_error) else { return };
        for error in self.error.per_frame.iter_mut().flat_map(|error| [&mut error.l2, &mut error.linf]) {
            if (bound..bound * ROUNDED).contains(error) {
                *error = bound;
            }
        }
    }
}

/// How frames were coded. Steps are fractions of the diagonal.
#[derive(Clone, Copy, Debug, Default, Deserialize, PartialEq, Serialize)]
#[serde(default)]
pub struct Coding {
    /// Guaranteed: no point of any frame is farther from where it was captured.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub max_error: Option<f64>,
    /// Step of the cages: root mean square over the points of what one coefficient moves the model.
    pub cage_step: f64,
    /// Step of the residual; absent from files without one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub residual_step: Option<f64>,
    /// Most frames of a group.
    pub group_frames: usize,
}

/// Condition numbers.
#[derive(Clone, Copy, Debug, Default, Deserialize, PartialEq, Serialize, ToSchema)]
#[serde(default)]
pub struct ConditionNumber {
    /// Of `Φ`.
    #[schema(required = true)]
    #[serde(deserialize_with = "number_or_null")]
    pub full: f64,
    /// Of the handles' rows.
    #[schema(required = true)]
    #[serde(deserialize_with = "number_or_null")]
    pub handles: f64,
}

/// Sizes.
#[derive(Clone, Copy, Debug, Default, Deserialize, PartialEq, Serialize)]
#[serde(default)]
pub struct Bytes {
    /// f32 positions of all frames and one connectivity.
    pub capture: u64,
    /// The written file.
    pub output: u64,
    /// `capture / output`.
    pub ratio: f64,
    /// Bits of the file per point and frame.
    #[serde(deserialize_with = "number_or_null")]
    pub bits_per_vertex_per_frame: f64,
}

/// Times, each added up over the threads that worked on it.
#[derive(Clone, Copy, Debug, Default, Deserialize, PartialEq, Serialize)]
#[serde(default)]
pub struct Seconds {
    /// Reading rest pose, cage and frames.
    pub read: f64,
    /// Designing the cage and choosing its size; absent where a cage was given.
    #[serde(skip_serializing_if = "is_zero")]
    pub design: f64,
    /// Computing `Φ`.
    pub coordinates: f64,
    /// Choosing the handles.
    pub maxvol: f64,
    /// Spectrum, regularisation and operator.
    pub svd: f64,
    /// Inverting all frames.
    pub invert: f64,
    /// Decoding all frames again and measuring them.
    pub measure: f64,
    /// Coding and decoding meshes and groups of frames, if these are coded.
    #[serde(skip_serializing_if = "is_zero")]
    pub code: f64,
    /// Compressing and writing.
    pub write: f64,
    /// Wall-clock time of it all.
    pub total: f64,
}

impl Seconds {
    fn are_zero(&self) -> bool {
        *self == Self::default()
    }
}

// By reference, as serde calls it.
#[allow(clippy::trivially_copy_pass_by_ref)]
fn is_zero(seconds: &f64) -> bool {
    *seconds == 0.0
}

/// What [`number_or_null`] does, for numbers of which some were not computed.
fn numbers_or_null<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Vec<f64>, D::Error> {
    let numbers: Vec<Option<f64>> = Deserialize::deserialize(deserializer)?;
    Ok(numbers.into_iter().map(|number| number.unwrap_or(f64::NAN)).collect())
}
