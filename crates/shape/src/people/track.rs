//! A sequence: each frame from the one before or, where that is lost, from a search; then once more from the last frame to the first.

use super::fit::{FrameFit, PersonFit};
use super::limbs::limb_scores;
use crate::registration::Observation;

/// A frame of a sequence.
#[derive(Clone, Debug)]
pub struct TrackedFrame {
    /// Its fit.
    pub fit: FrameFit,
    /// Its score, or that of an arm or leg, is far above that of the others, even from a search: part of the person is not there or not found.
    pub lost: bool,
    /// It was found by a search.
    pub searched: bool,
}

/// A frame whose score is this many times the usual one of the frames before is searched for.
const SUSPECT: f64 = 1.15;
/// A frame is lost above this many times the usual score.
const LOST_RATIO: f64 = 1.5;
/// And where a limb is, above this many times the usual score of the worst limb: an arm that lies elsewhere hardly moves the score of the whole.
const LIMB_LOST: f64 = 1.85;
/// No frame is found above this score, a share of the height.
const MAX_SCORE: f64 = 0.03;
/// Frames that the usual score is of.
const WINDOW: usize = 31;

/// In the second pass, frames whose score is below this many times that of the next one are left as they are.
const AGREED: f64 = 0.9;

/// Fits a sequence forwards, frame by frame as they come.
pub struct PersonTracker<'f, 'a> {
    fit: &'f PersonFit<'a>,
    frames: Vec<TrackedFrame>,
}

impl<'f, 'a> PersonTracker<'f, 'a> {
    /// Before the first frame.
    pub fn new(fit: &'f PersonFit<'a>) -> Self {
        Self { fit, frames: Vec::new() }
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
        if !frame.searched && usual.is_some_and(|usual| frame.fit.score > SUSPECT * usual) {
            let found = fit.fit(observation, None);
            if found.score < frame.fit.score {
                frame = TrackedFrame { fit: found, lost: false, searched: true };
            }
        }
        frame.lost = frame.fit.score > MAX_SCORE || usual.is_some_and(|usual| frame.fit.score > LOST_RATIO * usual);
        frames.push(frame);
        &frames[frames.len() - 1]
    }

    /// The second pass, from the last frame to the first.
    pub fn back(self) -> BackwardPass<'f, 'a> {
        let usual = usual_of(self.frames.iter().map(|frame| frame.fit.score));
        BackwardPass { fit: self.fit, frames: self.frames, usual }
    }
}

/// Fits a sequence backwards after [`PersonTracker`], keeping the better fit of each frame.
pub struct BackwardPass<'f, 'a> {
    fit: &'f PersonFit<'a>,
    frames: Vec<TrackedFrame>,
    /// The usual score of the first pass.
    usual: Option<f64>,
}

impl BackwardPass<'_, '_> {
    /// Fits a frame from the one after it, unless it lies well already; to be called from the last frame to the first.
    pub fn refit(&mut self, number: usize, observation: impl FnOnce() -> Observation) {
        let (before, from) = self.frames.split_at_mut(number + 1);
        let (Some(frame), Some(from)) = (before.last_mut(), from.first()) else { return };
        if from.lost || frame.fit.score < AGREED * from.fit.score {
            return;
        }
        let again = self.fit.fit(&observation(), Some(&from.fit));
        frame.take_better(again, self.usual);
    }

    /// All frames; which of them are lost follows from the usual score of all.
    pub fn into_frames(mut self) -> Vec<TrackedFrame> {
        judge(&mut self.frames);
        self.frames
    }
}

impl TrackedFrame {
    /// Takes another fit if it is better; the frame is found then, if it is good, so that the one before can be fitted from it.
    fn take_better(&mut self, again: FrameFit, usual: Option<f64>) {
        if again.score < self.fit.score {
            self.lost = again.score > MAX_SCORE || usual.is_some_and(|usual| again.score > LOST_RATIO * usual);
            self.fit = again;
        }
    }
}

/// Says which frames are lost.
fn judge(frames: &mut [TrackedFrame]) {
    let usual = usual_of(frames.iter().map(|frame| frame.fit.score));
    let usual_limb = usual_of(frames.iter().map(|frame| worst_limb(&frame.fit)));
    let (Some(usual), Some(usual_limb)) = (usual, usual_limb) else { return };
    for frame in frames {
        let most = MAX_SCORE.min(LOST_RATIO * usual);
        frame.lost = frame.fit.score > most || worst_limb(&frame.fit) > LIMB_LOST * usual_limb;
    }
}

fn worst_limb(fit: &FrameFit) -> f64 {
    limb_scores(&fit.parts).into_iter().fold(0.0, f64::max)
}

/// The lower quartile: frames that are off raise it least.
fn usual_of(scores: impl Iterator<Item = f64>) -> Option<f64> {
    let mut scores: Vec<f64> = scores.collect();
    scores.sort_unstable_by(f64::total_cmp);
    scores.get(scores.len() / 4).copied()
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
        lost.take_better(frame(0.05, 0.007).fit, Some(0.01));
        assert!(lost.lost && lost.fit.score == 0.04);
        lost.take_better(frame(0.02, 0.007).fit, Some(0.01));
        assert!(lost.lost && lost.fit.score == 0.02);
        lost.take_better(frame(0.012, 0.007).fit, Some(0.01));
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
