//! How large steps are: for a bound and a size by what the first frames cost, for a mean error and a size held in every group.

use super::group::{CodedGroup, GroupCoder, Room};
use super::{CodingError, Goal};

/// Frames that steps are chosen by.
const TRIAL: usize = 48;
/// Step of the cage over that of the residual, both as what they move the points, where nothing was measured.
const USUAL_RATIO: f64 = 1.6;
/// Step of the residual over the largest error allowed, likewise.
const USUAL_STEP: f64 = 1.8;

impl GroupCoder<'_> {
    /// Step and ratio by what the first frames cost.
    pub(super) fn choose(&self) -> Result<(f64, f64), CodingError> {
        let count = self.frames.len().min(TRIAL);
        match self.goal {
            Goal::Preview => Ok((2.8e-3 * self.diagonal / USUAL_RATIO * self.per_row(), USUAL_RATIO)),
            Goal::Standard => Ok((3e-3 * self.diagonal, USUAL_RATIO)),
            Goal::MaxError(error) => {
                let size = |step: f64, ratio: f64| Ok(self.code(count, step, ratio)?.bytes());
                let unit = error * self.diagonal;
                let (mut best, mut chosen) = (size(USUAL_STEP * unit, USUAL_RATIO)?, (USUAL_STEP, USUAL_RATIO));
                for (step, ratio) in [(1.0, 1.6), (1.0, 1.0 / 1.6), (1.4, 1.0), (1.0 / 1.4, 1.0)] {
                    let tried = (chosen.0 * step, chosen.1 * ratio);
                    let found = size(tried.0 * unit, tried.1)?;
                    if found < best {
                        (best, chosen) = (found, tried);
                    }
                }
                Ok((chosen.0 * unit, chosen.1))
            }
            // Found for every group: see below.
            Goal::MeanError(error) => Ok((4.0 * error * self.diagonal, USUAL_RATIO)),
            Goal::Size(_) => Ok((1e-3 * self.diagonal, USUAL_RATIO)),
        }
    }

    /// Root of points over rows of a cage: a step of this times the unit moves the points by about the unit.
    fn per_row(&self) -> f64 {
        (self.decoder.points() as f64 / self.basis.rows() as f64).sqrt()
    }

    /// The group in the largest step, or the smallest, that is `fine`, to a twentieth; all steps on the other side of it are. Begins at the step of the
    /// group before. `None` where no step is.
    fn group_in(
        &mut self,
        largest: bool,
        fine: impl Fn(&CodedGroup) -> bool,
    ) -> Result<Option<CodedGroup>, CodingError> {
        let (start, ratio) = self.chosen.unwrap_or((1e-3 * self.diagonal, USUAL_RATIO));
        let (least, most) = (1e-7 * self.diagonal, 2.0 * self.diagonal);
        let all = self.frames.len();
        // Steps that are too small to count are not fine.
        let tried = |step: f64| match self.code(all, step, ratio) {
            Ok(group) if fine(&group) => Ok(Some(group)),
            Ok(_) | Err(CodingError::Uncountable { .. }) => Ok(None),
            Err(error) => Err(error),
        };
        let mut step = start.clamp(least, most);
        let mut found = tried(step)?;
        let further = if found.is_some() == largest { 2.0 } else { 0.5 };
        let mut best = step;
        loop {
            let next = step * further;
            if !(least..=most).contains(&next) {
                break;
            }
            let group = tried(next)?;
            let was_fine = found.is_some();
            step = next;
            if group.is_some() {
                (found, best) = (group, next);
                if !was_fine {
                    break;
                }
            } else if was_fine {
                break;
            }
        }
        if found.is_some() {
            // Between a step that is fine and one twice or half as large that is not.
            let mut factor = if largest { 2.0f64 } else { 0.5 };
            for _ in 0..4 {
                factor = factor.sqrt();
                if let Some(group) = tried(best * factor)? {
                    (found, best) = (Some(group), best * factor);
                }
            }
            self.chosen = Some((best, ratio));
        }
        Ok(found)
    }

    pub(super) fn code_to_mean(&mut self, goal: f64) -> Result<CodedGroup, CodingError> {
        let found = self.group_in(true, |group| group.mean() <= goal)?;
        let asked = goal / self.diagonal;
        found.ok_or(CodingError::BelowPrecision { asked, least: 2.0 * asked })
    }

    /// In the bytes that belong to these of the frames that are left.
    pub(super) fn code_to_size(&mut self, asked: u64) -> Result<CodedGroup, CodingError> {
        let room = self.room.unwrap_or_default();
        let part = self.frames.len() as f64 / room.frames.max(1) as f64;
        let share = (room.bytes as f64 * part) as u64;
        if let Some(group) = self.group_in(false, |group| group.bytes() <= share)? {
            let (bytes, frames) = (room.bytes - group.bytes(), room.frames - self.frames.len());
            self.room = Some(Room { bytes, frames, ..room });
            return Ok(group);
        }
        let coarsest = self.code(self.frames.len(), 2.0 * self.diagonal, USUAL_RATIO)?.bytes();
        Err(CodingError::TooSmall { asked, least: room.other + (coarsest as f64 / part).ceil() as u64 })
    }
}
