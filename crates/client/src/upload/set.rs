//! Sets of frame numbers as intervals: captures are long and have few gaps.

use cager_proto::messages::FrameCounts;
use std::collections::BTreeMap;

/// A range of frames `[first, end)`; without an end it goes on to the last frame, wherever that is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct FrameRange {
    pub(crate) first: u32,
    pub(crate) end: Option<u32>,
}

/// A set of frames.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct FrameSet {
    /// First to end; ranges neither overlap nor touch.
    ranges: BTreeMap<u32, u32>,
}

impl FrameSet {
    /// The frames that are solved, as the service counts them: all below the highest one but those that are missing.
    ///
    /// `None` where the counts contradict each other.
    pub(crate) fn solved(counts: &FrameCounts) -> Option<Self> {
        let mut missing = 0_u64;
        for &[first, end] in &counts.missing {
            missing += u64::from(end.checked_sub(first)?);
        }
        // If the list of missing ranges is incomplete, later frames are assumed missing; posting them again is harmless.
        let highest = match counts.missing_next {
            Some(next) => next,
            None => u32::try_from(counts.solved.checked_add(missing)?).ok()?,
        };
        let mut set = Self::default();
        let mut next = 0;
        for &[first, end] in &counts.missing {
            if first < next || end > highest {
                return None;
            }
            set.insert(next, first);
            next = end;
        }
        set.insert(next, highest);
        Some(set)
    }

    /// Adds the frames `[first, end)`; true if one of them is new.
    pub(crate) fn insert(&mut self, mut first: u32, mut end: u32) -> bool {
        if first >= end {
            return false;
        }
        if let Some((&before, &before_end)) = self.ranges.range(..=first).next_back()
            && before_end >= first
        {
            if before_end >= end {
                return false;
            }
            first = before;
        }
        // Ranges that begin within the new one, or right after it, become a part of it.
        while let Some((&later, &later_end)) = self.ranges.range(first..=end).next() {
            end = end.max(later_end);
            self.ranges.remove(&later);
        }
        self.ranges.insert(first, end);
        true
    }

    #[cfg(test)]
    fn contains(&self, frame: u32) -> bool {
        self.ranges.range(..=frame).next_back().is_some_and(|(_, &end)| end > frame)
    }

    /// Number of frames.
    pub(crate) fn len(&self) -> u64 {
        self.ranges.iter().map(|(first, end)| u64::from(end - first)).sum()
    }

    /// One past the highest frame.
    pub(crate) fn end(&self) -> u32 {
        self.ranges.last_key_value().map_or(0, |(_, &end)| end)
    }

    /// What of `[0, total)` is not in the set; without a total the last range has no end.
    pub(crate) fn missing(&self, total: Option<u32>) -> Vec<FrameRange> {
        let mut missing = Vec::new();
        let mut next = 0;
        for (&first, &end) in &self.ranges {
            let stop = total.map_or(first, |total| first.min(total));
            if next < stop {
                missing.push(FrameRange { first: next, end: Some(stop) });
            }
            next = end;
        }
        if total.is_none_or(|total| next < total) {
            missing.push(FrameRange { first: next, end: total });
        }
        missing
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::collections::BTreeSet;

    proptest! {
        #[test]
        fn a_set_of_ranges_is_a_set(
            inserted in prop::collection::vec((0..60_u32, 0..8_u32), 0..20),
            total in prop::option::of(0..80_u32),
        ) {
            let mut ranges = FrameSet::default();
            let mut set = BTreeSet::new();
            for (first, length) in inserted {
                let before = set.len();
                set.extend(first..first + length);
                prop_assert_eq!(ranges.insert(first, first + length), set.len() > before);
            }
            prop_assert_eq!(ranges.len(), set.len() as u64);
            prop_assert_eq!(ranges.end(), set.last().map_or(0, |last| last + 1));
            for frame in 0..80 {
                prop_assert_eq!(ranges.contains(frame), set.contains(&frame));
            }
            let missing = ranges.missing(total);
            let listed: Vec<u32> = missing.iter().flat_map(|r| r.first..r.end.unwrap_or(80)).collect();
            let expected: Vec<u32> = (0..total.unwrap_or(80)).filter(|f| !set.contains(f)).collect();
            prop_assert_eq!(listed, expected);
            prop_assert!(missing.windows(2).all(|w| w[0].end.is_some_and(|end| end < w[1].first)), "{:?}", missing);
        }

        #[test]
        fn the_counts_of_the_service_give_the_set_back(frames in prop::collection::btree_set(0..60_u32, 0..40)) {
            let highest = frames.last().map_or(0, |last| last + 1);
            let mut expected = FrameSet::default();
            for &frame in &frames {
                expected.insert(frame, frame + 1);
            }
            let missing: Vec<[u32; 2]> =
                expected.missing(Some(highest)).iter().map(|r| [r.first, r.end.unwrap_or(highest)]).collect();
            let counts = FrameCounts { received: 0, solved: frames.len() as u64, missing, missing_next: None };
            prop_assert_eq!(FrameSet::solved(&counts), Some(expected));
        }

        #[test]
        fn counts_that_contradict_themselves_do_no_harm(
            solved in any::<u64>(),
            missing in prop::collection::vec(any::<[u32; 2]>(), 0..5),
        ) {
            let _ = FrameSet::solved(&FrameCounts { received: 0, solved, missing, missing_next: None });
        }
    }

    #[test]
    fn counts_that_contradict_themselves_are_noticed() {
        let solved = |solved, missing: &[[u32; 2]]| {
            FrameSet::solved(&FrameCounts { received: 0, solved, missing: missing.to_vec(), missing_next: None })
        };
        assert_eq!(solved(u64::MAX, &[]), None);
        assert_eq!(solved(0, &[[5, 3]]), None);
        assert_eq!(solved(1, &[[3, 5], [1, 2]]), None);
        assert_eq!(solved(0, &[[5, 9]]), None);
        assert!(solved(5, &[[5, 9]]).is_some(), "declared at completion, missing at the end");
    }
}
