//! What the options of a recovery say.

use crate::preparation::{check_told, goal};
use crate::problem::{self, ApiError};
use cager_capture::coding::Goal;
use cager_geometry::units::Up;
use cager_motion::recover::RecoverOptions;
use cager_proto::messages::SessionOptions;
use cager_proto::recovery_messages::{Placing, RecoveryOptions};
use cager_shape::people::{FitOptions, Method};
use std::ops::RangeInclusive;

/// Most frames of a recovery, an hour and more; each takes memory to its end.
pub(super) const MAX_FRAMES: u32 = 100_000;

const POINTS: RangeInclusive<u32> = 100..=1_000_000;
const DEFAULT_POINTS: u32 = 15_000;

/// Validated options.
#[derive(Clone, Copy)]
pub(super) struct ValidOptions {
    pub(super) recover: RecoverOptions,
    pub(super) person: FitOptions,
    /// What the container is to meet; without it cages alone are stored.
    pub(super) goal: Option<Goal>,
}

impl ValidOptions {
    /// Validates the options.
    ///
    /// # Errors
    /// An option that is out of range, not available, or contradicts another.
    pub(super) fn of(options: &RecoveryOptions, has_rig: bool) -> Result<Self, ApiError> {
        let refuse = |detail: String| Err(ApiError::new(problem::INVALID_OPTIONS, detail));
        check_told(options.name.as_deref(), options.frame_rate, options.start)?;
        if options.frames == Some(0) {
            return refuse(
                "frames: an animation has at least one frame; leave it out where it is not known".to_owned(),
            );
        }
        if let Some(frames) = options.frames.filter(|&frames| frames > MAX_FRAMES) {
            return refuse(format!(
                "frames: is {frames}, and a recovery has at most {MAX_FRAMES}; make one for each part of the sequence"
            ));
        }
        let points = options.points.unwrap_or(DEFAULT_POINTS);
        if !POINTS.contains(&points) {
            return refuse(format!("points: is {points}; give a number from {} to {}", POINTS.start(), POINTS.end()));
        }
        let up = match options.up.as_deref() {
            None => None,
            Some("y") => Some(Up::Y),
            Some("z") => Some(Up::Z),
            Some(other) => return refuse(format!("up: {other:?} is no axis that points up; give y or z")),
        };
        let [align, scale] = [options.align, options.scale].map(|placing| placing == Some(Placing::Auto));
        if has_rig && (align || scale || up.is_some()) {
            return refuse("rig: finds the person wherever it is; leave out align, scale and up".to_owned());
        }
        let method = match options.method.as_deref() {
            None | Some("robust") => Method::Robust,
            Some("paper") => Method::Paper,
            Some(other) => return refuse(format!("method: {other:?} is not available; give robust or paper")),
        };
        if options.method.is_some() && !has_rig {
            return refuse("method: says how a rig is followed; send a rig and a manifold, or leave it out".to_owned());
        }
        let RecoveryOptions { max_error, mean_error, target_size, frames, offsets, force, .. } = *options;
        let quality = options.quality.clone();
        let coded = SessionOptions { max_error, mean_error, target_size, quality, frames, ..SessionOptions::default() };
        Ok(Self {
            recover: RecoverOptions { align, scale, up, offsets, force, points: points as usize, colors: false },
            person: FitOptions { method, ..FitOptions::default() },
            goal: goal(&coded)?,
        })
    }
}
