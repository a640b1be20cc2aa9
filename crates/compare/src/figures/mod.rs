//! The results of a comparison as plain data, for `--json` and the report.

mod random;
mod spectra;
mod summary;
mod swaps;

pub(crate) use random::{DRAW_FRAMES, DRAWS, Draw, draws};
pub(crate) use spectra::{Spectra, Vectors};
pub(crate) use summary::{Claim, Recommendation, claims, recommend};
pub(crate) use swaps::Swaps;

use super::evaluation::{PerFrame, Totals};
use super::methods::Method;
use serde::Serialize;

/// Everything a comparison finds out. Lengths are fractions of the rest pose's bounding-box
/// diagonal.
#[derive(Clone, Debug, Serialize)]
pub struct Figures {
    /// Version of the program.
    pub program: &'static str,
    /// What was compared on.
    pub capture: Capture,
    /// Each coordinate system, in the order asked for.
    pub systems: Vec<System>,
    /// Recommended options.
    pub recommendation: Recommendation,
    /// The paper's claims, checked on this capture.
    pub(crate) claims: Vec<Claim>,
}

/// The capture and its cage.
#[derive(Clone, Debug, Serialize)]
pub struct Capture {
    pub(crate) rest: String,
    pub(crate) cage: String,
    /// Whether the cage's faces pointed inwards and were turned.
    pub(crate) flip_cage: bool,
    pub(crate) source: String,
    pub(crate) points: usize,
    pub(crate) triangles: usize,
    pub(crate) cage_vertices: usize,
    pub(crate) cage_faces: usize,
    pub(crate) frames: usize,
    /// Frames whose errors and spikes are measured, from 0; each with its neighbours.
    pub measured: Vec<usize>,
    /// Diagonal of the rest pose's bounding box, in the capture's unit.
    pub(crate) diagonal: f64,
    /// Mean second temporal difference of the model's points; null for fewer than three frames.
    pub(crate) motion_mean: f64,
    pub(crate) motion_max: f64,
    /// The frame that the report draws: that of the largest spike of full least squares.
    pub(crate) shown: usize,
    pub(crate) noise_radius: f64,
}

/// A coordinate system.
#[derive(Clone, Debug, Serialize)]
pub struct System {
    /// Its name on the command line.
    pub name: String,
    /// Why there is nothing to compare, where it cannot be computed for this cage.
    pub refused: Option<String>,
    /// What was found, where it can.
    pub(crate) figures: Option<Box<SystemFigures>>,
}

#[derive(Clone, Debug, Serialize)]
pub(crate) struct SystemFigures {
    /// Unknowns per frame, m.
    pub(crate) unknowns: usize,
    /// Numerical rank of `Φ`.
    pub(crate) rank: usize,
    /// `max_i |Φ C_R − P_R|_i`.
    pub(crate) affine_reproduction_error: f64,
    pub(crate) outside: usize,
    /// Singular values and condition numbers (Figs. 6, 9).
    pub(crate) spectra: Spectra,
    /// Volume and condition number after every swap (Fig. 4).
    pub(crate) swaps: Swaps,
    pub(crate) random: Vec<Draw>,
    /// Every method (Figs. 8, 12–14, 18–20).
    pub(crate) methods: Vec<MethodFigures>,
    /// The same with noise on the frames (Fig. 16).
    pub(crate) noise: Vec<NoiseFigures>,
    /// Singular vectors of `Φ□` (Figs. 11, 15).
    pub(crate) vectors: Vectors,
    /// Times of the preparation (Table 1).
    pub(crate) seconds: Seconds,
}

#[derive(Clone, Debug, Serialize)]
pub(crate) struct MethodFigures {
    #[serde(flatten)]
    pub(crate) method: Method,
    pub(crate) totals: Totals,
    pub(crate) per_frame: PerFrame,
    /// Seconds of one inversion, on one thread, in a batch: the least of all batches.
    pub(crate) frame_seconds: f64,
}

/// A method on frames with noise.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct NoiseFigures {
    #[serde(flatten)]
    pub(crate) method: Method,
    /// Means and maxima, errors against the frames with noise, as the paper has them.
    pub(crate) totals: Totals,
    pub(crate) per_frame: PerFrame,
    /// Mean L2 against the frames without noise.
    pub(crate) clean_l2_mean: f64,
    /// Largest L∞ against the frames without noise.
    pub(crate) clean_linf_max: f64,
}

#[derive(Clone, Copy, Debug, Serialize)]
pub(crate) struct Seconds {
    pub(crate) coordinates: f64,
    pub(crate) maxvol: f64,
    /// Decompositions of the handles and of all points, and the operator of `per_frame`.
    pub(crate) svd: f64,
    /// Inverting one frame by the paper's method at the usual threshold.
    pub(crate) per_frame: f64,
}

impl SystemFigures {
    /// The first method for which this holds.
    pub(crate) fn method(&self, wanted: impl Fn(&Method) -> bool) -> Option<&MethodFigures> {
        self.methods.iter().find(|found| wanted(&found.method))
    }
}
