//! How large steps are: for a bound and a size by what the first frames cost, for a mean error and a size held in every group.

use super::group::{CodedGroup, GroupCoder, Room};
use super::{CodingError, Goal};

/// Frames that steps are chosen by.
const TRIAL: usize = 48;
/// Step of the cage over that of the residual, both as what they move the points, where nothing was measured.
const USUAL_RATIO: f64 = 1.6;
/// Step of the residual over the largest error allowed, likewise.
const USUAL_STEP: f64 = 1.8;

impl GroupCoder {
    /// Step and ratio by what the first frames cost.
    pub(super) fn choose(&self) -> Result<(f64, f64), CodingError> {
        let count = self.frames.len().min(TRIAL);
        match self.goal {
            Goal::Preview => Ok((2.8e-3 * self.diagonal / USUAL_RATIO * self.per_row(), USUAL_RATIO)),
            Goal::Standard => Ok((3e-3 * self.diagonal, USUAL_RATIO)),
            Goal::MaxError(error) => {
                let unit = error * self.diagonal;
                let size = |(step, ratio): (f64, f64)| {
                    self.encode(count, step * unit, ratio).map(|group| (group.bytes(), (step, ratio)))
                };
                let usual = (USUAL_STEP, USUAL_RATIO);
                let mut best = size(usual)?;
                for (step, ratio) in [(1.0, 1.6), (1.4, 1.0)] {
                    let (_, from) = best;
                    let (more, less) =
                        rayon::join(|| size((from.0 * step, from.1 * ratio)), || size((from.0 / step, from.1 / ratio)));
                    best = [more?, less?]
                        .into_iter()
                        .fold(best, |best, tried| if tried.0 < best.0 { tried } else { best });
                }
                let (_, (step, ratio)) = best;
                Ok((step * unit, ratio))
            }
            // Found for every group: see below.
            Goal::MeanError(error) => Ok((4.0 * error * self.diagonal, USUAL_RATIO)),
            Goal::Size(_) => Ok((1e-3 * self.diagonal, USUAL_RATIO)),
        }
    }

    /// Root of points over rows of a cage: a step of this times the unit moves the points by about the unit.
    fn per_row(&self) -> f64 {
        (self.model.points() as f64 / self.model.basis.rows() as f64).sqrt()
    }

    /// Bytes of the frames that wait, in the steps where [`Self::choose`] begins for a bound.
    pub(super) fn usual_bytes(&self) -> Result<u64, CodingError> {
        let Goal::MaxError(error) = self.goal else { return Ok(0) };
        let step = USUAL_STEP * error * self.diagonal;
        self.encode(self.frames.len(), step, USUAL_RATIO).map(|group| group.bytes())
    }

    /// What `tried` gives for the largest step, or the smallest, for which it gives anything, to a twentieth; it does for all steps on the other side
    /// of it. Begins at the step of the group before. `None` where it does for no step.
    fn for_step<T>(
        &mut self,
        largest: bool,
        tried: impl Fn(&Self, f64, f64) -> Result<Option<T>, CodingError>,
    ) -> Result<Option<T>, CodingError> {
        let (start, ratio) = self.carried.chosen.unwrap_or((1e-3 * self.diagonal, USUAL_RATIO));
        let (least, most) = (1e-7 * self.diagonal, 2.0 * self.diagonal);
        // Steps that are too small to count are not fine.
        let tried = |step: f64| match tried(self, step, ratio) {
            Err(CodingError::Uncountable { .. }) => Ok(None),
            found => found,
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
            self.carried.chosen = Some((best, ratio));
        }
        Ok(found)
    }

    pub(super) fn code_to_mean(&mut self, goal: f64) -> Result<CodedGroup, CodingError> {
        let found = self.for_step(true, |coder, step, ratio| {
            let group = coder.code(coder.frames.len(), step, ratio)?;
            Ok(Some(group).filter(|group| group.mean() <= goal))
        })?;
        let asked = goal / self.diagonal;
        found.ok_or(CodingError::BelowPrecision { asked, least: 2.0 * asked })
    }

    /// In the bytes that belong to these of the frames that are left.
    pub(super) fn code_to_size(&mut self, asked: u64) -> Result<CodedGroup, CodingError> {
        let room = self.carried.room.unwrap_or_default();
        let part = self.frames.len() as f64 / room.frames.max(1) as f64;
        let share = (room.bytes as f64 * part) as u64;
        let found = self.for_step(false, |coder, step, ratio| {
            let group = coder.encode(coder.frames.len(), step, ratio)?;
            Ok(Some(group).filter(|group| group.bytes() <= share))
        })?;
        if let Some(group) = found {
            let (bytes, frames) = (room.bytes - group.bytes(), room.frames.saturating_sub(self.frames.len()));
            self.carried.room = Some(Room { bytes, frames, other: room.other + group.bytes() });
            return self.finish(group);
        }
        let coarsest = self.encode(self.frames.len(), 2.0 * self.diagonal, USUAL_RATIO)?.bytes();
        Err(CodingError::TooSmall { asked, least: room.other + (coarsest as f64 / part).ceil() as u64 })
    }
}
