//! Errors of a decoded capture, as fractions of the rest pose's diagonal.

use cager_core::numbers::number_or_null;
use serde::{Deserialize, Serialize};

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
    /// The frame of the largest error, over this diagonal; none where nothing was measured.
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
