//! What coded files are to meet, and how large steps and groups are for it.

use super::error::CodingError;
use cager_proto::container;
use cager_proto::report::Coding;
use serde::{Deserialize, Serialize};

/// What a coded file is to meet; errors are fractions of the rest pose's diagonal.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Goal {
    /// No point of any frame is farther from where it was captured.
    MaxError(f64),
    /// The root mean square error of the points, averaged over the frames, is at most this.
    MeanError(f64),
    /// The file has at most so many bytes.
    Size(u64),
    /// Cages alone, in steps that hardly add to their error.
    Preview,
    /// A few steps of residual: errors that are not seen.
    Standard,
}

impl Goal {
    /// The quality for what is to be worked on later.
    pub const MASTER: Self = Self::MaxError(1e-4);

    /// Refuses an error below what [machines differ](slack) by in single precision.
    ///
    /// # Errors
    /// [`CodingError::BelowPrecision`].
    pub fn check_precision(self, diagonal: f64, slack: f64) -> Result<(), CodingError> {
        let (asked, times) = match self {
            Self::MaxError(error) => (error, 2.0),
            Self::MeanError(error) => (error, 1.0),
            _ => return Ok(()),
        };
        let least = times * slack / diagonal;
        if asked < least {
            // As it is printed, with room for other groups, so that asking for it is not refused.
            let least = 1.5 * least;
            let unit = 10f64.powf(least.log10().floor() - 1.0);
            return Err(CodingError::BelowPrecision { asked, least: (least / unit).ceil() * unit, farthest: None });
        }
        Ok(())
    }

    /// The steps for a residual's step and the cage's over it, for so many points.
    pub(super) fn steps(self, (residual, ratio): (f64, f64), points: usize) -> Steps {
        let cage = ratio * residual / (points as f64).sqrt();
        Steps { cage, residual: (self != Self::Preview).then_some(residual) }
    }

    /// How frames were coded that left `carried`, as a report says it.
    pub fn coding(self, carried: &Carried, points: usize, diagonal: f64, group_frames: usize) -> Option<Coding> {
        let steps = self.steps(carried.chosen?, points);
        let max_error = if let Self::MaxError(error) = self { Some(error) } else { None };
        let residual_step = steps.residual.map(|step| step / diagonal);
        Some(Coding { max_error, cage_step: steps.cage / diagonal, residual_step, group_frames })
    }

    /// What the size leaves for so many frames after the `written` bytes of the meshes.
    pub fn room(self, written: u64, frames: usize) -> Option<Room> {
        let Self::Size(bytes) = self else { return None };
        let other = written + around(frames);
        Some(Room { bytes: bytes.saturating_sub(other), frames, other })
    }

    /// Refuses a size that meshes of so many bytes fill already.
    ///
    /// # Errors
    /// [`CodingError::TooSmall`].
    pub fn check_size(self, meshes: u64, frames: usize) -> Result<(), CodingError> {
        match (self, self.room(meshes, frames)) {
            (Self::Size(asked), Some(Room { bytes: 0, .. })) => {
                Err(CodingError::TooSmall { asked, least: least_size(meshes, LEAST_GROUP + around(frames)) })
            }
            _ => Ok(()),
        }
    }
}

impl Room {
    /// A size that is met where all frames, of which `done` are coded, take so many bytes.
    pub(super) fn least(&self, done: usize, bytes: u64) -> u64 {
        let around = around(done + self.frames);
        least_size(self.other.saturating_sub(around), bytes + around)
    }
}

/// Steps of the numbers, in the capture's unit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Steps {
    pub(super) cage: f64,
    pub(super) residual: Option<f64>,
}

/// What is left of a size.
#[derive(Clone, Copy, Debug, Default, Deserialize, PartialEq, Serialize)]
pub struct Room {
    /// Bytes for frames.
    pub bytes: u64,
    /// Frames.
    pub frames: usize,
    /// Bytes of everything else, and of groups before.
    pub other: u64,
}

/// What one group leaves to the next, for a coder that goes on.
#[derive(Clone, Copy, Debug, Default, Deserialize, PartialEq, Serialize)]
pub struct Carried {
    /// Frames in the groups so far.
    pub frames: usize,
    /// Step of the residual and of the cage over it; set by the first group.
    pub chosen: Option<(f64, f64)>,
    /// What is left, where a size was asked for.
    pub room: Option<Room>,
}

/// What positions may differ by from machine to machine, where for a coordinate so many `terms` are
/// [added up](cager_core::decode::Decoder::largest_sum) whose sizes are at most `sum` together, and
/// coordinates are at most `farthest`.
///
/// In single precision both factors of a term are rounded, and each partial sum is, by at most u of
/// it: together at most n·u·`sum`, and as the signs of roundings are as good as random,
/// 2·√n·u·`sum` is six standard deviations or more (Higham and Mary 2019). The coordinates are
/// rounded by a unit in the last place of each of three.
pub fn slack(diagonal: f64, terms: usize, sum: f64, farthest: f64) -> f64 {
    let unit = f64::from(f32::EPSILON) / 2.0;
    let rounding = (2.0 + 2.0 * (terms as f64).sqrt()) * unit * sum;
    rounding.max(1e-6 * diagonal.max(sum)) + 4.0 * unit * farthest
}

/// Most bytes that coding a group holds, and bytes for each position: captured, of its cage, as
/// residual, decoded.
const MAX_HELD_BYTES: usize = 512 << 20;
pub(crate) const BYTES_PER_POSITION: usize = 112;

/// Most frames of a group, the same on every machine, so that files are the same.
pub fn group_frames(points: usize, rows: usize) -> usize {
    container::group_frames(points, rows).min(MAX_HELD_BYTES / (BYTES_PER_POSITION * points.max(1))).max(1)
}

/// Bytes of a file after so many frames, about.
fn around(frames: usize) -> u64 {
    AROUND + 4 * frames as u64
}

/// A size that is met with meshes of so many bytes: the rest pose may take a third of it, and the
/// cage is about a sixth of the meshes.
fn least_size(meshes: u64, others: u64) -> u64 {
    (meshes + others).max(3 * others / 2 + meshes / 4)
}

/// Bytes of a group in which nothing moves, about.
const LEAST_GROUP: u64 = 100;

/// Bytes of report and table of contents, about, but for four a frame.
const AROUND: u64 = 1200;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_least_error_that_is_told_is_not_refused() {
        for farthest in [0.0, 0.5, 3.7, 130.0, 9_876.5] {
            for goal in [Goal::MaxError, Goal::MeanError] {
                let slack = slack(1.7, 350, 0.9, farthest);
                let told = match goal(1e-9).check_precision(1.7, slack) {
                    Err(CodingError::BelowPrecision { least, .. }) => format!("{least:.1e}"),
                    other => panic!("{other:?}"),
                };
                assert_eq!(goal(told.parse().unwrap()).check_precision(1.7, slack), Ok(()), "{told}");
            }
        }
    }
}
