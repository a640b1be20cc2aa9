//! The report of an encoding: what `cager encode` writes as JSON, what a container keeps of it, and what `cager inspect` shows.
//!
//! Errors are fractions of the rest pose's bounding-box diagonal, times are seconds.

use crate::container::Header;
use cager_core::coordinates::Refinement;
use cager_core::inversion::{Convergence, Outcome};
use cager_core::numbers::number_or_null;
use cager_core::spectral::Threshold;
use cager_core::spectral::maxvol::Volume;
use cager_geometry::units::Units;
use serde::{Deserialize, Deserializer, Serialize};

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
    /// Diagonal of the rest pose's bounding box, in the unit of its file: what errors are fractions of.
    pub diagonal: f64,
    /// What is added to all positions, of a capture that lies far from the origin of its coordinates.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub origin: Option<[f64; 3]>,
    /// The length of 1 in metres, where it is known.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub metres_per_unit: Option<f64>,
    /// The axis that points up, `y` or `z`, where it is known.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub up: Option<String>,
    /// The number of each frame where it comes from, as in the names of its files; absent where they are 0, 1, 2, …
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
    /// Singular values of the inverted matrix, descending; NaN, in JSON `null`, where they were not computed. Of 1,024 unknowns or more, of
    /// which few are regularised, only the first and the last are; containers then have none of them.
    #[serde(deserialize_with = "numbers_or_null", skip_serializing_if = "Vec::is_empty")]
    pub singular_values: Vec<f64>,
    /// How the handles of maximum volume were found.
    pub maxvol: Volume,
    /// Rows read, in their order: those of maximum volume first. Where every point is read, only those.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub handle_indices: Vec<u32>,
    /// Errors of what a decoder of the written file gets back.
    pub error: Errors,
    /// How frames were coded, where an error, a size or a quality was asked for.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub coding: Option<Coding>,
    /// Sizes.
    pub bytes: Bytes,
    /// Times. Reading, inverting and measuring overlap, so `total` is less than the sum on several processors. Absent where they are all
    /// zero, as of a container.
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

    /// Says how many bytes the written file has, once the frames are counted and the size of the capture is known.
    pub fn set_output(&mut self, output: u64) {
        let bytes = &mut self.bytes;
        bytes.output = output;
        bytes.ratio = bytes.capture as f64 / output as f64;
        bytes.bits_per_vertex_per_frame = 8.0 * output as f64 / (self.points * self.frames) as f64;
    }

    /// The JSON that a container stores: without what its other sections say and what differs from run to run.
    pub(crate) fn stored(&self) -> serde_json::Result<Vec<u8>> {
        const ELSEWHERE: [&str; 18] = [
            "points",
            "frames",
            "frame_rate",
            "diagonal",
            "origin",
            "metres_per_unit",
            "up",
            "frame_numbers",
            "unknowns",
            "cage_vertices",
            "cage_faces",
            "coordinates",
            "handles",
            "regularizer",
            "spectrum",
            "lambda",
            "bytes",
            "seconds",
        ];
        // Of many bytes beside coded frames, and of little use without the cage they were found for.
        const LONG: [&str; 2] = ["singular_values", "handle_indices"];
        let mut value = serde_json::to_value(self)?;
        if let Some(report) = value.as_object_mut() {
            let short = self.coding.is_some();
            // Earlier programs read numbers alone.
            let partial = self.singular_values.iter().any(|x| x.is_nan());
            let left_out = |key: &str| {
                ELSEWHERE.contains(&key) || short && LONG.contains(&key) || partial && key == "singular_values"
            };
            report.retain(|key, _| !left_out(key));
        }
        if let Some(error) = value["error"].as_object_mut() {
            error.retain(|key, _| key != "worst" && key != "per_frame");
        }
        serde_json::to_vec(&value)
    }
}

impl Report {
    /// Files keep few digits of an error, rounded up: what passes a guaranteed error by that alone is the guaranteed one.
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
    /// Step of the cages: the root mean square over the points of what one coefficient moves the model.
    pub cage_step: f64,
    /// Step of the residual; absent from files without one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub residual_step: Option<f64>,
    /// Most frames of a group.
    pub group_frames: usize,
}

/// Condition numbers.
#[derive(Clone, Copy, Debug, Default, Deserialize, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(default)]
pub struct ConditionNumber {
    /// Of `Φ`.
    #[cfg_attr(feature = "schema", schema(required = true))]
    #[serde(deserialize_with = "number_or_null")]
    pub full: f64,
    /// Of the handles' rows.
    #[cfg_attr(feature = "schema", schema(required = true))]
    #[serde(deserialize_with = "number_or_null")]
    pub handles: f64,
}

/// How a spectrum threshold was chosen: the largest whose mean L2 error on some frames of the capture stays within a bound of that at
/// threshold 0.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
pub struct SpectrumChoice {
    /// Bound of the extra error, as a fraction.
    pub bound: f64,
    /// Extra error at the chosen threshold, as a fraction.
    pub extra: f64,
    /// Frames measured, evenly spaced.
    pub frames: usize,
    /// Thresholds tried, ascending.
    pub tried: Vec<TriedSpectrum>,
}

/// A threshold that was tried.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Serialize)]
pub struct TriedSpectrum {
    /// The threshold s.
    pub spectrum: usize,
    /// Mean L2 error of the frames measured.
    pub l2_mean: f64,
}

impl SpectrumChoice {
    /// What choosing within a bound found.
    pub fn new(found: &Threshold, bound: f64) -> Self {
        let tried = found.tried.iter().map(|&(spectrum, l2_mean)| TriedSpectrum { spectrum, l2_mean }).collect();
        Self { bound, extra: found.extra(), frames: found.frames, tried }
    }
}

/// How a cage was designed. Errors are least-squares errors over sampled points, root mean square.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
pub struct DesignReport {
    /// `free` or `editable`.
    pub style: String,
    /// Seed of what was drawn at random.
    pub seed: u64,
    /// Vertices of the cage.
    pub vertices: usize,
    /// Frames that the design was made from; the best of its cages was chosen by as many or one less that lie between them.
    pub frames: usize,
    /// Frames in stretches of time that neither saw; 0 where there were too few to hold some back.
    #[serde(default)]
    pub unseen_frames: usize,
    /// Error on the frames that the design was made from.
    pub designed_error: f64,
    /// Error on those that the cage was chosen by.
    pub held_back_error: f64,
    /// Error on those that neither saw.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub unseen_error: Option<f64>,
    /// Whether the time limit ended it.
    pub timed_out: bool,
    /// What each stage brought.
    pub stages: Vec<StageReport>,
}

/// What one stage of a design brought.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
pub struct StageReport {
    /// What was done.
    pub name: String,
    /// Vertices after it.
    pub vertices: usize,
    /// Error after it on frames that the design is made from.
    pub designed_error: f64,
    /// Error after it on the frames between them, by which the best cage is chosen.
    pub held_back_error: f64,
    /// Condition number of the coordinates after it; absent where they are singular, and where it was not computed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub condition_number: Option<f64>,
    /// Whether the coordinates were singular after it.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub singular: bool,
    /// Seconds since the design began.
    pub seconds: f64,
}

/// How the inversion of coordinates went whose normals follow from the vertices: it starts from a linear one and improves its
/// cages.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Serialize)]
pub struct Consistency {
    /// Mean over frames of the Gauss–Newton steps taken.
    pub steps_mean: f64,
    /// Most steps of a frame.
    pub steps_max: usize,
    /// Mean over frames of the L2 error of the points read, as the linear inversion leaves it.
    pub start_l2_mean: f64,
    /// Mean over frames of the L2 error of the points read.
    pub l2_mean: f64,
    /// Frames whose last step changed next to nothing.
    pub converged: usize,
    /// Frames that took as many steps as are allowed, each of them an improvement.
    pub stopped: usize,
    /// Frames that no step improved: their cages are those of the linear inversion.
    pub kept_start: usize,
}

impl Consistency {
    /// Of all frames; `None` where there was no iteration.
    pub fn new(frames: &[Convergence]) -> Option<Self> {
        if frames.is_empty() {
            return None;
        }
        let mean = |f: fn(&Convergence) -> f64| frames.iter().map(f).sum::<f64>() / frames.len() as f64;
        let count = |outcome| frames.iter().filter(|frame| frame.outcome == outcome).count();
        Some(Self {
            steps_mean: mean(|frame| frame.steps as f64),
            steps_max: frames.iter().map(|frame| frame.steps).max().unwrap_or(0),
            start_l2_mean: mean(|frame| frame.start),
            l2_mean: mean(|frame| frame.residual),
            converged: count(Outcome::Converged),
            stopped: count(Outcome::StepLimit),
            kept_start: count(Outcome::KeptStart),
        })
    }
}

/// Errors of the decoded capture; NaN where they were not measured.
#[derive(Clone, Debug, Default, Deserialize, PartialEq, Serialize)]
#[serde(default)]
pub struct Errors {
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
    /// `100 · ‖A − Â‖_F / ‖A − E(A)‖_F` (Karni and Gotsman 2004).
    #[serde(deserialize_with = "number_or_null")]
    pub kg_percent: f64,
    /// Where it is largest, if that was measured.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub worst: Option<WorstError>,
    /// Every frame.
    pub per_frame: Vec<FrameError>,
}

impl Errors {
    /// Makes the errors of these frames, and with them those of all together, not measured.
    pub fn forget(&mut self, frames: &[bool]) {
        let unknown = f64::NAN;
        for (error, _) in self.per_frame.iter_mut().zip(frames).filter(|(_, forgotten)| **forgotten) {
            *error = FrameError { l2: unknown, linf: unknown };
        }
        for all in [&mut self.l2_mean, &mut self.l2_max, &mut self.linf_mean, &mut self.linf_max, &mut self.kg_percent]
        {
            *all = unknown;
        }
    }
}

/// The largest error of a capture.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Serialize)]
pub struct WorstError {
    /// The frame, counted from 0.
    pub frame: usize,
    /// The point, where the positions are at hand to tell.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub point: Option<u32>,
    /// How far off it is, in the unit of the capture.
    pub distance: f64,
}

impl WorstError {
    /// The frame of the largest error, over a rest pose of this diagonal; none where nothing was measured.
    pub(crate) fn of_frames(frames: &[FrameError], diagonal: f64) -> Option<Self> {
        let measured = frames.iter().enumerate().filter(|(_, error)| error.linf.is_finite());
        let (frame, error) = measured.reduce(|a, b| if b.1.linf > a.1.linf { b } else { a })?;
        Some(Self { frame, point: None, distance: error.linf * diagonal })
    }
}

/// Errors of one frame; NaN where they were not measured.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Serialize)]
pub struct FrameError {
    /// `sqrt(mean |e|²)`.
    #[serde(deserialize_with = "number_or_null")]
    pub l2: f64,
    /// `max |e|`.
    #[serde(deserialize_with = "number_or_null")]
    pub linf: f64,
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
    /// Designing the cage, with the choice of its size and the frames read for that; absent where a cage was given.
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
    /// Coding meshes and groups of frames, with decoding and measuring them; absent where no error, size or quality was asked for.
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
