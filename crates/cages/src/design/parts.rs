//! Which frames a design is made from, which choose its best cage, and which judge that one unseen.

use std::ops::Range;

/// From so many frames on, stretches of time are held back: of fewer, they would be a frame or two.
const FEWEST: usize = 26;
/// From so many on, there are three stretches; two before.
const THREE_FROM: usize = 100;
/// Share of the frames that is held back.
const SHARE: f64 = 0.12;
/// One of so many frames is left out on each side of a stretch: it is like what the design sees.
const BESIDE: usize = 80;

/// The frames of a capture by what they are for, in order.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Parts {
    /// A cage is moved to fit these.
    pub designed: Vec<usize>,
    /// The best of the cages on the way is chosen by these, which lie between the others.
    pub choosing: Vec<usize>,
    /// Stretches of time that neither sees; none of few frames.
    pub unseen: Vec<Range<usize>>,
}

impl Parts {
    /// Of so many frames; a single one is designed from and chosen by.
    pub fn of(frames: usize) -> Self {
        let count = if frames < THREE_FROM { 2 } else { 3 };
        let length = (SHARE * frames as f64 / count as f64).round() as usize;
        let beside = (frames / BESIDE).max(1);
        let middles = (0..count).filter(|_| frames >= FEWEST).map(|k| (2 * k + 1) * frames / (2 * count));
        let unseen: Vec<Range<usize>> =
            middles.map(|middle| middle - length / 2..middle - length / 2 + length).collect();
        let is_near = |frame: &usize| unseen.iter().any(|s| s.start <= frame + beside && *frame < s.end + beside);
        let others: Vec<usize> = (0..frames).filter(|frame| !is_near(frame)).collect();
        let every_second = |first: usize| -> Vec<usize> { others.iter().copied().skip(first).step_by(2).collect() };
        let designed = every_second(0);
        let choosing = if frames > 1 { every_second(1) } else { designed.clone() };
        Self { designed, choosing, unseen }
    }

    /// How many frames are unseen.
    pub fn unseen_frames(&self) -> usize {
        self.unseen.iter().map(ExactSizeIterator::len).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stretches_that_are_held_back_are_apart_from_all_that_is_seen() {
        for frames in 1..400 {
            let Parts { designed, choosing, unseen } = Parts::of(frames);
            assert!(!designed.is_empty() && !choosing.is_empty(), "{frames}");
            assert_eq!(unseen.is_empty(), frames < FEWEST, "{frames}");
            for stretch in &unseen {
                assert!(stretch.len() >= 2 && stretch.start > 2 && stretch.end + 2 < frames, "{frames}: {stretch:?}");
                let near = |frame: &usize| stretch.start <= frame + 1 && *frame <= stretch.end;
                assert!(!designed.iter().chain(&choosing).any(near), "{frames}: {stretch:?}");
            }
            let held = Parts::of(frames).unseen_frames() as f64 / frames as f64;
            assert!(unseen.is_empty() || (0.08..0.17).contains(&held), "{frames}: {held}");
            // What is seen is most of the capture, half of it for each.
            assert!(5 * (designed.len() + choosing.len()) >= 3 * frames && designed.len() < choosing.len() + 2);
        }
        assert_eq!(Parts::of(1).choosing, [0]);
        assert_eq!(Parts::of(4).choosing, [1, 3]);
    }
}
