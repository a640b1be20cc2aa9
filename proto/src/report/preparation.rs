//! How the cage, the spectrum threshold and the cages of frames were found.

use cager_core::inversion::{Convergence, Outcome};
use cager_core::spectral::Threshold;
use serde::{Deserialize, Serialize};

/// How a cage was designed. Errors are least-squares errors over sampled points, root mean square.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
pub struct DesignReport {
    /// `free` or `editable`.
    pub style: String,
    /// Seed of what was drawn at random.
    pub seed: u64,
    /// Vertices of the cage.
    pub vertices: usize,
    /// Frames that the design was made from; about as many chose the best of its cages.
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
    /// Condition number of the coordinates after it; absent where singular or not computed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub condition_number: Option<f64>,
    /// Whether the coordinates were singular after it.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub singular: bool,
    /// Seconds since the design began.
    pub seconds: f64,
}

/// How a spectrum threshold was chosen: the largest within a bound of the error at 0.
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

/// How the inversion went of coordinates whose normals follow from the vertices.
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
