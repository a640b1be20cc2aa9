//! What is told of a transfer.

use cager_shape::quality::MotionSummary;
use serde::Serialize;

/// How a motion was moved, as JSON.
#[derive(Clone, Debug, Default, Serialize)]
pub struct TransferReport {
    /// `fitted`, `public` or `rigid`.
    pub method: &'static str,
    /// Points of the target.
    pub points: usize,
    /// Frames.
    pub frames: usize,
    /// The angle by which the source was turned to be aligned, in degrees.
    pub turned_degrees: f64,
    /// The factor by which it was scaled.
    pub scale: f64,
    /// The next best alignment's score over the best one's; none where only one was tried.
    pub runner_up: Option<f64>,
    /// How far the source stays from the target, over the diagonal. Of the fitted cage alone.
    pub score: Option<f64>,
    /// `relative` or `absolute`. Of the fitted cage alone.
    pub pose: Option<&'static str>,
    /// The share of the source's area turned by more than 30 degrees. Of the fitted cage alone.
    pub turned_area: Option<f64>,
    /// Vertices of the source's cage, or of the one around both.
    pub cage_vertices: usize,
    /// Whether the detail of the target at rest was brought back to every frame.
    pub detail: bool,
    /// What the motion does to the target.
    pub quality: MotionSummary,
    /// How long it took.
    pub seconds: Seconds,
    /// For each point of the target, a point of the source that lies there. Of the fitted cage
    /// alone.
    pub correspondence: Option<Vec<u32>>,
}

/// Seconds of each part.
#[derive(Clone, Copy, Debug, Default, Serialize)]
pub struct Seconds {
    /// Cages, coordinates, alignment, registration.
    pub prepare: f64,
    /// All frames.
    pub frames: f64,
    /// What the quality was measured in.
    pub measure: f64,
}
