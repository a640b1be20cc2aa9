//! `report.json`: what encoding found out, for programs and people.

use crate::design::DesignReport;
use cager_core::inversion::{Convergence, Outcome};
use serde::{Deserialize, Serialize};

/// The report of one encoding. Lengths are fractions of the rest pose's bounding-box diagonal.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
pub struct Report {
    /// Points of the model, n.
    pub points: usize,
    /// Triangles of the model; 0 for a point cloud.
    pub triangles: usize,
    /// Frames of the capture.
    pub frames: usize,
    /// Diagonal of the rest pose's bounding box, in the unit of its file: what errors are fractions of.
    #[serde(default)]
    pub diagonal: f64,
    /// The number of each frame where it comes from, as in the names of its files; absent where they are 0, 1, 2, …
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
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
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub spectrum_choice: Option<SpectrumChoice>,
    /// Weight λ.
    pub lambda: f64,
    /// How the cage was designed, where none was given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub design: Option<DesignReport>,
    /// How the iteration went, for coordinates whose inversion is one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub consistency: Option<Consistency>,
    /// How the coordinates were refined, where they are a numerical solution.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub refinement: Option<Refinement>,
    /// `max_i |Φ C_R − P_R|_i`.
    pub affine_reproduction_error: f64,
    /// Condition numbers over the numerical rank.
    pub condition_number: Condition,
    /// Numerical rank of `Φ`.
    pub rank: usize,
    /// Singular values of the inverted matrix, descending.
    pub singular_values: Vec<f64>,
    /// How the handles of maximum volume were found.
    pub maxvol: MaxVol,
    /// Rows read, in their order: those of maximum volume first. Where every point is read, only those.
    pub handle_indices: Vec<u32>,
    /// Errors of what a decoder of the written file gets back.
    pub error: Errors,
    /// Sizes.
    pub bytes: Bytes,
    /// Times. Reading, inverting and measuring overlap, so `total` is less than the sum on several processors.
    pub seconds: Seconds,
    /// What a user should know but that did not stop the work.
    pub warnings: Vec<String>,
}

/// How a numerical solution for the coordinates was refined.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Serialize)]
pub struct Refinement {
    /// Boundary elements of the last solution.
    pub elements: usize,
    /// Solutions after the first.
    pub refinements: usize,
    /// About how far a coordinate may be off: by what refining last changed, or by what the solution leaves of its equations; at most
    /// 1e-3 but where a warning says otherwise.
    pub change: f64,
}

impl From<cager_core::coordinates::Refinement> for Refinement {
    fn from(found: cager_core::coordinates::Refinement) -> Self {
        Self { elements: found.elements, refinements: found.refinements, change: found.change }
    }
}

/// Condition numbers.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Serialize)]
pub struct Condition {
    /// Of `Φ`.
    pub full: f64,
    /// Of the handles' rows.
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
    pub fn new(found: &cager_core::inversion::Threshold, bound: f64) -> Self {
        let tried = found.tried.iter().map(|&(spectrum, l2_mean)| TriedSpectrum { spectrum, l2_mean }).collect();
        Self { bound, extra: found.extra(), frames: found.frames, tried }
    }
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

/// How the handles were found.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Serialize)]
pub struct MaxVol {
    /// Swaps after the start by pivoted LU.
    pub swaps: usize,
    /// `ln |det Φ□|`.
    pub log_volume: f64,
    /// Largest `|B_ij|` at the end.
    pub max_entry: f64,
}

/// Errors of the decoded capture.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
pub struct Errors {
    /// Mean over frames of the L2 error.
    pub l2_mean: f64,
    /// Largest L2 error of a frame.
    pub l2_max: f64,
    /// Mean over frames of the L∞ error.
    pub linf_mean: f64,
    /// Largest L∞ error of a frame.
    pub linf_max: f64,
    /// `100 · ‖A − Â‖_F / ‖A − E(A)‖_F` (Karni and Gotsman 2004).
    pub kg_percent: f64,
    /// Where it is largest, if that was measured.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub worst: Option<WorstError>,
    /// Every frame.
    pub per_frame: Vec<FrameError>,
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
    pub fn of_frames(frames: &[FrameError], diagonal: f64) -> Option<Self> {
        let measured = frames.iter().enumerate().filter(|(_, error)| error.linf.is_finite());
        let (frame, error) = measured.reduce(|a, b| if b.1.linf > a.1.linf { b } else { a })?;
        Some(Self { frame, point: None, distance: error.linf * diagonal })
    }
}

/// Errors of one frame.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Serialize)]
pub struct FrameError {
    /// `sqrt(mean |e|²)`.
    pub l2: f64,
    /// `max |e|`.
    pub linf: f64,
}

/// Sizes.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Serialize)]
pub struct Bytes {
    /// f32 positions of all frames and one connectivity.
    pub capture: u64,
    /// The written file.
    pub output: u64,
    /// `capture / output`.
    pub ratio: f64,
    /// Bits of the file per point and frame.
    pub bits_per_vertex_per_frame: f64,
}

/// Times in seconds, each added up over the threads that worked on it.
#[derive(Clone, Copy, Debug, Default, Deserialize, PartialEq, Serialize)]
pub struct Seconds {
    /// Reading rest pose, cage and frames.
    pub read: f64,
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
    /// Compressing and writing.
    pub write: f64,
    /// Wall-clock time of it all.
    pub total: f64,
}
