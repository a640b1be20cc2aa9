//! A sequence: each frame from the one before, those that are lost anew, and back again.

use super::fit::{FrameFit, PersonFit};
use cager_registration::Observation;

/// A frame of a sequence.
#[derive(Clone, Debug)]
pub struct TrackedFrame {
    /// Its fit.
    pub fit: FrameFit,
    /// Its score is far above that of the others, even from a search: the person is not there or not found.
    pub lost: bool,
    /// It was found by a search.
    pub searched: bool,
}

/// A frame whose score is this many times the usual one of the frames before is searched for anew.
const SUSPECT: f64 = 1.15;
/// A frame is lost above this many times the usual score.
const LOST: f64 = 2.0;
/// No frame is found above this score, a share of the height.
const MAX_SCORE: f64 = 0.03;
/// Frames that the usual score is of.
const WINDOW: usize = 31;

/// On the way back, frames whose score is below this many times that of the next one are left as they are.
const AGREED: f64 = 0.9;

/// Fits a sequence forwards and, where `back` says so, backwards from its end, keeping the better fit of each frame. `done` is told each frame of
/// the first pass.
pub fn track(
    fit: &PersonFit<'_>,
    observations: &[Observation],
    back: bool,
    mut done: impl FnMut(usize, &TrackedFrame),
) -> Vec<TrackedFrame> {
    let mut frames: Vec<TrackedFrame> = Vec::with_capacity(observations.len());
    for (number, observation) in observations.iter().enumerate() {
        let last = frames.last().filter(|frame| !frame.lost).map(|frame| &frame.fit);
        let usual = usual_of(frames.iter().rev().take(WINDOW).filter(|frame| !frame.lost).map(|frame| frame.fit.score));
        let mut frame = TrackedFrame { fit: fit.fit(observation, last), lost: false, searched: last.is_none() };
        if !frame.searched && usual.is_some_and(|usual| frame.fit.score > SUSPECT * usual) {
            let anew = fit.fit(observation, None);
            if anew.score < frame.fit.score {
                frame = TrackedFrame { fit: anew, lost: false, searched: true };
            }
        }
        frame.lost = frame.fit.score > MAX_SCORE || usual.is_some_and(|usual| frame.fit.score > LOST * usual);
        done(number, &frame);
        frames.push(frame);
    }
    if back {
        let usual = usual_of(frames.iter().map(|frame| frame.fit.score));
        for number in (0..frames.len().saturating_sub(1)).rev() {
            let from = &frames[number + 1];
            if from.lost {
                continue;
            }
            if frames[number].fit.score < AGREED * from.fit.score {
                continue;
            }
            let again = fit.fit(&observations[number], Some(&from.fit));
            if again.score < frames[number].fit.score {
                frames[number].fit = again;
            }
            let score = frames[number].fit.score;
            frames[number].lost = score > MAX_SCORE || usual.is_some_and(|usual| score > LOST * usual);
        }
    }
    frames
}

/// The lower quartile: frames that are off raise it least.
fn usual_of(scores: impl Iterator<Item = f64>) -> Option<f64> {
    let mut scores: Vec<f64> = scores.collect();
    scores.sort_unstable_by(f64::total_cmp);
    scores.get(scores.len() / 4).copied()
}
