//! How large steps are: for a bound by some frames of the first group, for a mean error and a size
//! in every group.

use super::error::CodingError;
use super::goal::{Goal, Room};
use super::group::{CodedGroup, GroupCoder};
use std::ops::Range;
use std::sync::Arc;

/// Most frames that steps are chosen by, and points of large models: fewer gave larger files.
const TRIAL_FRAMES: usize = 32;
const TRIAL_POINTS: usize = 10_000;
/// Points of all frames that the first steps for a mean error are found by.
const MEAN_POINTS: usize = 1_500;
/// Step of the cage over that of the residual, both in the points, where nothing was measured.
const USUAL_RATIO: f64 = 1.6;
/// The other ratio tried for a mean error where the residual has fewer than so many times the
/// cages' bytes.
const FINER_CAGES: f64 = 1.1;
const LITTLE_RESIDUAL: f64 = 0.1;
/// Power of the step that a mean error is about: larger steps leave more of the residual out.
const USUAL_POWER: f64 = 0.7;
/// Step of the residual over the largest error allowed, likewise.
const USUAL_STEP: f64 = 1.8;

/// Figures so near to what is allowed are good enough, and so are steps so near to each other.
const NEAR: f64 = 1.02;
/// Most steps that are tried for a group.
const MAX_TRIALS: usize = 20;

/// The power of the step that figures are about, from those of two steps where these say it.
fn power_between(before: Option<(f64, f64)>, (step, figure): (f64, f64), usual: f64) -> f64 {
    let power = before.map_or(usual, |(s, f)| (figure / f).ln() / (step / s).ln());
    if (0.2..5.0).contains(&(power / usual)) { power } else { usual }
}

/// The step whose figure is a little below 1, by that of another.
fn next_step(step: f64, figure: f64, power: f64) -> f64 {
    step * (NEAR.sqrt() * figure).powf(-1.0 / power).clamp(0.125, 8.0)
}

/// The frames that steps are chosen by: a run in either half, as captures may begin calmly.
fn trial_frames(count: usize) -> [Range<usize>; 2] {
    let middle_of = |half: Range<usize>| {
        let run = half.len().min(TRIAL_FRAMES / 2);
        let first = half.start + (half.len() - run) / 2;
        first..first + run
    };
    [middle_of(0..count / 2), middle_of(count / 2..count)]
}

impl GroupCoder {
    /// Step and ratio by what some frames cost, of some patches of a large model.
    pub(super) fn choose(&self) -> Result<(f64, f64), CodingError> {
        match self.goal {
            Goal::Preview => Ok((2.8e-3 * self.diagonal / USUAL_RATIO * self.per_row(), USUAL_RATIO)),
            Goal::Standard => Ok((3e-3 * self.diagonal, USUAL_RATIO)),
            Goal::MaxError(error) => {
                let unit = error * self.diagonal;
                let trial = self.part(TRIAL_POINTS, trial_frames(self.frames.len()).into_iter().flatten());
                let part = trial.model.points() as f64 / self.model.points() as f64;
                let size = |(step, ratio): (f64, f64)| {
                    let bytes = trial.estimate(trial.frames.len(), step * unit, ratio * part.sqrt(), part);
                    bytes.map(|(bytes, _)| (bytes, (step, ratio)))
                };
                let mut best = size((USUAL_STEP, USUAL_RATIO))?;
                for (step, ratio) in [(1.4, 1.0), (1.0, 1.6)] {
                    let (_, from) = best;
                    let (more, less) = ((from.0 * step, from.1 * ratio), (from.0 / step, from.1 / ratio));
                    let (more, less) = rayon::join(|| size(more), || size(less));
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

    /// A coder of some frames, of a large model with about so many points in patches.
    fn part(&self, points: usize, frames: impl IntoIterator<Item = usize>) -> Self {
        let every = self.model.points() / points;
        let (model, points) = if every < 2 {
            (Arc::clone(&self.model), None)
        } else {
            let (model, points) = self.model.part(every);
            (Arc::new(model), Some(points))
        };
        let of_points = |frame: &Vec<f64>| match &points {
            Some(points) => points.iter().flat_map(|&i| frame[3 * i as usize..][..3].iter().copied()).collect(),
            None => frame.clone(),
        };
        let mut part = Self::new(self.goal, model, self.diagonal, self.most, self.carried);
        for frame in frames {
            part.frames.push(of_points(&self.frames[frame]));
            part.cages.push(self.cages[frame].clone());
        }
        part
    }

    /// Root of points over rows: a cage's step of this moves the points by about one.
    fn per_row(&self) -> f64 {
        (self.model.points() as f64 / self.model.basis.rows() as f64).sqrt()
    }

    /// What `tried` gives in the step where its figure, over what is allowed, is nearly 1 and not
    /// above; the figure is about the power `usual` of the step. Begins at the step of the group
    /// before. `None` where no step does it.
    fn for_step<T>(
        &mut self,
        usual: f64,
        tried: impl Fn(&Self, f64, f64) -> Result<(T, f64), CodingError>,
    ) -> Result<Option<T>, CodingError> {
        let (start, ratio) = self.carried.chosen.unwrap_or((1e-3 * self.diagonal, USUAL_RATIO));
        let (least, most) = (1e-7 * self.diagonal, 2.0 * self.diagonal);
        let mut step = start.clamp(least, most);
        // Between a step that is fine and one that is not.
        let mut best: Option<(f64, f64, T)> = None;
        let mut refused: Option<f64> = None;
        let mut before: Option<(f64, f64)> = None;
        for _ in 0..MAX_TRIALS {
            let figure = match tried(self, step, ratio) {
                Ok((found, figure)) => {
                    let is_fine = figure <= 1.0;
                    if is_fine && best.as_ref().is_none_or(|(_, closest, _)| figure >= *closest) {
                        best = Some((step, figure, found));
                    } else if !is_fine {
                        refused = Some(step);
                    }
                    figure.max(1e-6)
                }
                // Steps that are too small to count.
                Err(CodingError::Uncountable { .. }) => {
                    refused = Some(step);
                    if usual > 0.0 { 1e-6 } else { 1e6 }
                }
                Err(error) => return Err(error),
            };
            let fine = best.as_ref().map(|(step, ..)| *step);
            let near = |(fine, refused): (f64, f64)| (fine / refused).ln().abs() < NEAR.ln();
            if (1.0 / NEAR..=1.0).contains(&figure) || fine.zip(refused).is_some_and(near) {
                break;
            }
            let power = power_between(before, (step, figure), usual);
            let mut next = next_step(step, figure, power);
            if let Some((fine, refused)) = fine.zip(refused)
                && !(fine.min(refused)..=fine.max(refused)).contains(&next)
            {
                next = (fine * refused).sqrt();
            }
            let next = next.clamp(least, most);
            if next == step {
                break;
            }
            before = Some((step, figure));
            step = next;
        }
        Ok(best.map(|(step, _, found)| {
            self.carried.chosen = Some((step, ratio));
            found
        }))
    }

    /// In the largest steps that meet a mean error; of two ratios where the first group has little
    /// residual.
    pub(super) fn code_to_mean(&mut self, goal: f64) -> Result<CodedGroup, CodingError> {
        let usual = self.code_in_ratio(goal)?;
        let Some((step, ratio)) = self.carried.chosen else { return Ok(usual) };
        let residual = usual.residual.as_ref().map_or(0, Vec::len);
        if self.carried.frames == 0 && LITTLE_RESIDUAL * usual.cages.len() as f64 > residual as f64 {
            self.carried.chosen = Some((step * (USUAL_RATIO / FINER_CAGES).sqrt(), FINER_CAGES));
            // It only may save bytes: what cannot be coded in it is coded in the usual one.
            if let Ok(finer) = self.code_in_ratio(goal)
                && finer.bytes() < usual.bytes()
            {
                return Ok(finer);
            }
            self.carried.chosen = Some((step, ratio));
        }
        Ok(usual)
    }

    /// Begins at the step that some of the points suggest.
    fn code_in_ratio(&mut self, goal: f64) -> Result<CodedGroup, CodingError> {
        let mut power = USUAL_POWER;
        let is_large = self.model.points() >= 2 * MEAN_POINTS;
        if let Some((mut step, ratio)) = self.carried.chosen.filter(|_| is_large) {
            let part = self.part(MEAN_POINTS, 0..self.frames.len());
            let share = part.model.points() as f64 / self.model.points() as f64;
            let mut before = None;
            for _ in 0..2 {
                let tried = part.estimate(part.frames.len(), step, ratio * share.sqrt(), share);
                let Ok((_, mut group)) = tried else { break };
                part.measure(&mut group);
                let figure = (group.group.mean() / goal).max(1e-6);
                power = power_between(before, (step, figure), USUAL_POWER);
                before = Some((step, figure));
                step = next_step(step, figure, power);
            }
            self.carried.chosen = Some((step, ratio));
        }
        let found = self.for_step(power, |coder, step, ratio| {
            let mut group = coder.encode(coder.frames.len(), step, ratio)?;
            coder.measure(&mut group);
            let mean = group.group.mean();
            Ok((group, mean / goal))
        })?;
        let asked = goal / self.diagonal;
        self.finish(found.ok_or(CodingError::BelowPrecision { asked, least: 2.0 * asked, farthest: None })?)
    }

    /// In the bytes that belong to these of the frames that are left.
    pub(super) fn code_to_size(&mut self, asked: u64) -> Result<CodedGroup, CodingError> {
        let room = self.carried.room.unwrap_or_default();
        // Frames may come that were not expected.
        let part = self.frames.len() as f64 / room.frames.max(self.frames.len()) as f64;
        let share = (room.bytes as f64 * part) as u64;
        let found = self.for_step(-1.0, |coder, step, ratio| {
            let group = coder.encode(coder.frames.len(), step, ratio)?;
            let bytes = group.group.bytes();
            Ok((group, bytes as f64 / share.max(1) as f64))
        })?;
        let found = match found {
            Some(group) => group,
            None => {
                let steps = (2.0 * self.diagonal, USUAL_RATIO);
                let coarsest = self.encode(self.frames.len(), steps.0, steps.1)?;
                if coarsest.group.bytes() > share {
                    let bytes = (coarsest.group.bytes() as f64 / part).ceil() as u64;
                    return Err(CodingError::TooSmall { asked, least: room.least(self.carried.frames, bytes) });
                }
                self.carried.chosen = Some(steps);
                coarsest
            }
        };
        let (bytes, frames) =
            (room.bytes.saturating_sub(found.group.bytes()), room.frames.saturating_sub(self.frames.len()));
        self.carried.room = Some(Room { bytes, frames, other: room.other + found.group.bytes() });
        self.finish(found)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_trial_has_a_run_of_frames_in_either_half_or_all_there_are() {
        for count in [0, 1, 2, 3, 31, 32, 33, 34, 63, 64, 175, 256] {
            let [first, second] = trial_frames(count);
            assert_eq!(first.len() + second.len(), count.min(TRIAL_FRAMES), "{count}");
            assert!(first.end <= second.start && second.end <= count, "{count}: {first:?} {second:?}");
        }
        assert_eq!(trial_frames(175), [35..51, 123..139]);
    }
}
