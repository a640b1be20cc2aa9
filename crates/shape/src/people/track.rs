//! A sequence: each frame from the one before or, if lost, from a search; then once more backwards.

use super::fit::{FrameFit, PersonFit};
use super::limbs::limb_scores;
use crate::registration::Observation;

/// A frame of a sequence.
#[derive(Clone, Debug)]
pub struct TrackedFrame {
    /// Its fit.
    pub fit: FrameFit,
    /// Its score, or that of a limb, is far above the others': part of the person is not found.
    pub lost: bool,
    /// It was found by a search.
    pub searched: bool,
}

/// A frame whose score is this many times the usual one of the frames before is searched for.
const SUSPECT: f64 = 1.15;
/// A frame is lost above this many times the usual score.
const LOST_RATIO: f64 = 1.5;
/// And a limb's above this many times the usual one of the worst limb: it hardly moves the whole's.
const LIMB_LOST: f64 = 1.85;
/// No frame is found above this score, a share of the height.
const MAX_SCORE: f64 = 0.03;
/// Frames that the usual score is of.
const WINDOW: usize = 31;

/// Frames that score below so many times the next one are left as they are in the second pass.
const AGREED: f64 = 0.9;

/// Fits a sequence forwards, frame by frame as they come, then backwards.
pub struct PersonTracker<'f, 'a> {
    fit: &'f PersonFit<'a>,
    frames: Vec<TrackedFrame>,
    /// The usual score of the first pass, once that is over.
    usual: Option<f64>,
}

impl<'f, 'a> PersonTracker<'f, 'a> {
    /// Before the first frame.
    pub fn new(fit: &'f PersonFit<'a>) -> Self {
        Self { fit, frames: Vec::new(), usual: None }
    }

    /// The frames so far.
    pub fn frames(&self) -> &[TrackedFrame] {
        &self.frames
    }

    /// Fits the next frame.
    pub fn follow(&mut self, observation: &Observation) -> &TrackedFrame {
        let (fit, frames) = (self.fit, &mut self.frames);
        let last = frames.last().filter(|frame| !frame.lost).map(|frame| &frame.fit);
        let usual = usual_of(frames.iter().rev().take(WINDOW).filter(|frame| !frame.lost).map(|frame| frame.fit.score));
        let mut frame = TrackedFrame { fit: fit.fit(observation, last), lost: false, searched: last.is_none() };
        if !frame.searched && frame.fit.score > SUSPECT * usual {
            let found = fit.fit(observation, None);
            if found.score < frame.fit.score {
                frame = TrackedFrame { fit: found, lost: false, searched: true };
            }
        }
        frame.lost = is_lost(&frame.fit, usual);
        frames.push(frame);
        &frames[frames.len() - 1]
    }

    /// Fits a frame from the one after it, unless it lies well, and keeps the better fit; from the
    /// last frame to the first, after all were followed.
    pub fn refit(&mut self, number: usize, observation: &Observation) {
        let scores = self.frames.iter().map(|frame| frame.fit.score);
        let usual = *self.usual.get_or_insert_with(|| usual_of(scores));
        let (before, from) = self.frames.split_at_mut(number + 1);
        let (Some(frame), Some(from)) = (before.last_mut(), from.first()) else { return };
        if !from.lost && frame.fit.score >= AGREED * from.fit.score {
            frame.take_better(self.fit.fit(observation, Some(&from.fit)), usual);
        }
    }

    /// All frames; which of them are lost follows from the usual score of all.
    pub fn into_frames(mut self) -> Vec<TrackedFrame> {
        judge(&mut self.frames);
        self.frames
    }
}

fn is_lost(fit: &FrameFit, usual: f64) -> bool {
    fit.score > MAX_SCORE || fit.score > LOST_RATIO * usual
}

impl TrackedFrame {
    /// Takes another fit if it is better.
    fn take_better(&mut self, again: FrameFit, usual: f64) {
        if again.score < self.fit.score {
            self.lost = is_lost(&again, usual);
            self.fit = again;
        }
    }
}

/// Says which frames are lost.
fn judge(frames: &mut [TrackedFrame]) {
    let usual = usual_of(frames.iter().map(|frame| frame.fit.score));
    let usual_limb = usual_of(frames.iter().map(|frame| worst_limb(&frame.fit)));
    for frame in frames {
        frame.lost = is_lost(&frame.fit, usual) || worst_limb(&frame.fit) > LIMB_LOST * usual_limb;
    }
}

fn worst_limb(fit: &FrameFit) -> f64 {
    limb_scores(&fit.parts).into_iter().fold(0.0, f64::max)
}

/// The lower quartile: frames that are off raise it least. Infinite without any.
fn usual_of(scores: impl Iterator<Item = f64>) -> f64 {
    let mut scores: Vec<f64> = scores.collect();
    scores.sort_unstable_by(f64::total_cmp);
    scores.get(scores.len() / 4).copied().unwrap_or(f64::INFINITY)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Similarity;
    use crate::people::rig::QUADS;

    fn frame(score: f64, arm: f64) -> TrackedFrame {
        let mut parts = [0.007; QUADS];
        parts[5..9].fill(arm);
        let (latent, pose, vertices) = (Vec::new(), Vec::new(), Vec::new());
        let fit = FrameFit { placement: Similarity::IDENTITY, latent, pose, vertices, score, parts };
        TrackedFrame { fit, lost: false, searched: false }
    }

    #[test]
    fn a_lost_frame_that_is_fitted_better_on_the_way_back_is_found() {
        let mut lost = TrackedFrame { lost: true, ..frame(0.04, 0.007) };
        lost.take_better(frame(0.05, 0.007).fit, 0.01);
        assert!(lost.lost && lost.fit.score == 0.04);
        lost.take_better(frame(0.02, 0.007).fit, 0.01);
        assert!(lost.lost && lost.fit.score == 0.02);
        lost.take_better(frame(0.012, 0.007).fit, 0.01);
        assert!(!lost.lost && lost.fit.score == 0.012);
    }

    #[test]
    fn a_frame_is_lost_where_it_or_one_limb_lies_far_worse_than_usual() {
        let mut frames: Vec<TrackedFrame> = (0..20).map(|k| frame(0.01, 0.007 + 1e-4 * f64::from(k % 5))).collect();
        frames[3] = frame(0.011, 0.0145);
        frames[7] = frame(0.016, 0.009);
        frames[9].lost = true;
        judge(&mut frames);
        let lost: Vec<usize> = (0..20).filter(|&k| frames[k].lost).collect();
        assert_eq!(lost, [3, 7]);
    }
}
