//! The frames of a session: those on disk and those being solved.

use super::upload::Upload;
use crate::store::{CagePlace, FrameEntry};
use cager_capture::capture::StoredError;
use rangemap::RangeSet;
use std::collections::{BTreeMap, HashMap};
use std::sync::Arc;

/// Longest list of missing ranges in a response.
pub(crate) const RANGES: usize = 1000;

/// Digests of a frame's rows, by which a frame posted again is recognised.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Digests {
    /// Of the handle rows.
    pub(crate) handles: [u8; 16],
    /// Of all rows; `None` if only handle rows were sent.
    pub(crate) full: Option<[u8; 16]>,
}

impl Digests {
    /// The entry of a frame with these digests and errors, whose place is not known yet.
    pub(super) fn entry(self, frame: u32, error: &StoredError) -> FrameEntry {
        let &StoredError { l2, linf, squared, spread } = error;
        let (handle_digest, full_digest) = (self.handles, self.full);
        FrameEntry { frame, place: CagePlace::default(), l2, linf, squared, spread, handle_digest, full_digest }
    }

    fn of(entry: &FrameEntry) -> Self {
        Self { handles: entry.handle_digest, full: entry.full_digest }
    }

    /// Whether both can be digests of the same frame.
    pub(crate) fn agree(&self, other: &Self) -> bool {
        self.handles == other.handles
            && match (self.full, other.full) {
                (Some(a), Some(b)) => a == b,
                _ => true,
            }
    }
}

/// A frame that is being solved or written, with the uploads waiting for it.
struct Pending {
    digests: Digests,
    waiting: Vec<Arc<Upload>>,
}

/// What to do with a frame that arrived.
#[derive(Debug, PartialEq, Eq)]
pub(crate) enum Claim {
    /// Solve it.
    Solve,
    /// Its cage was solved from handle rows; now that all rows are known, measure its errors.
    Measure,
    /// It is on disk with the same content.
    Known,
    /// The same frame is being solved; the upload is notified when that is done.
    Waiting,
    /// It was posted before with other content.
    Conflict,
    /// It is new, and the session is sealed.
    Sealed,
}

/// The frames of one session.
#[derive(Default)]
pub(crate) struct Frames {
    solved: BTreeMap<u32, FrameEntry>,
    /// The keys of `solved` as ranges, so that missing ones are found without visiting every frame.
    runs: RangeSet<u64>,
    pending: HashMap<u32, Pending>,
    /// Whether new frames are refused.
    sealed: bool,
}

/// A page of the frames that are missing.
#[derive(Debug, Default, PartialEq, Eq)]
pub(crate) struct Missing {
    /// Ranges `[a, b)`, ascending.
    pub(crate) ranges: Vec<[u32; 2]>,
    /// Where to continue, if the page does not list all of them.
    pub(crate) next: Option<u32>,
}

/// Why a session cannot be sealed.
#[derive(Debug, PartialEq, Eq)]
pub(crate) enum SealError {
    /// Frames are missing.
    Missing(Missing),
    /// This frame lies beyond the end.
    Beyond(u32),
    /// Frames that belong into the container are still being measured.
    Measuring,
}

impl Frames {
    #[cfg(test)]
    pub(crate) fn new(entries: Vec<FrameEntry>) -> Self {
        // Of a frame that is there twice, the first counts.
        let mut frames = Self::default();
        for entry in entries {
            frames.solved(entry);
        }
        frames
    }

    /// Decides about a frame that arrived.
    pub(crate) fn claim(&mut self, frame: u32, digests: Digests, upload: &Arc<Upload>) -> Claim {
        let known = self.solved.get(&frame).map(Digests::of);
        if let Some(known) = known {
            let measures = known.full.is_none() && digests.full.is_some() && !self.sealed;
            match known.agree(&digests) {
                false => return Claim::Conflict,
                true if !measures => return Claim::Known,
                true => {}
            }
        }
        if let Some(pending) = self.pending.get_mut(&frame) {
            if !pending.digests.agree(&digests) {
                return Claim::Conflict;
            }
            pending.waiting.push(Arc::clone(upload));
            return Claim::Waiting;
        }
        if self.sealed {
            return Claim::Sealed;
        }
        self.pending.insert(frame, Pending { digests, waiting: vec![Arc::clone(upload)] });
        if known.is_some() { Claim::Measure } else { Claim::Solve }
    }

    /// Refuses new frames from here on, provided all frames below `frames` are solved, none of them is being measured, and none beyond is solved or
    /// pending; with `discard`, solved frames beyond are allowed. Returns whether it was sealed before.
    ///
    /// # Errors
    /// [`SealError`]; nothing has changed.
    pub(crate) fn seal_at(&mut self, frames: u32, discard: bool) -> Result<bool, SealError> {
        let missing = self.missing(0, Some(frames), RANGES);
        if !missing.ranges.is_empty() {
            return Err(SealError::Missing(missing));
        }
        if self.pending.keys().any(|frame| *frame < frames && self.solved.contains_key(frame)) {
            return Err(SealError::Measuring);
        }
        let on_its_way = self.pending.keys().copied().max();
        let highest = self.highest().filter(|_| !discard);
        match highest.max(on_its_way).filter(|&highest| highest >= frames) {
            Some(highest) => Err(SealError::Beyond(highest)),
            None => Ok(std::mem::replace(&mut self.sealed, true)),
        }
    }

    /// Removes solved frames numbered `frames` and above.
    pub(crate) fn discard_from(&mut self, frames: u32) {
        self.solved.split_off(&frames);
        self.runs.remove(u64::from(frames)..u64::MAX);
    }

    /// Refuses new frames from here on.
    pub(crate) fn seal(&mut self) {
        self.sealed = true;
    }

    /// Whether new frames are refused.
    pub(crate) fn is_sealed(&self) -> bool {
        self.sealed
    }

    /// Accepts new frames again.
    pub(crate) fn unseal(&mut self) {
        self.sealed = false;
    }

    /// Adds a frame that is on disk; returns the uploads that wait for it.
    pub(crate) fn solved(&mut self, entry: FrameEntry) -> Vec<Arc<Upload>> {
        if self.adds_information(&entry) {
            self.solved.insert(entry.frame, entry);
        }
        self.runs.insert(u64::from(entry.frame)..u64::from(entry.frame) + 1);
        self.pending.remove(&entry.frame).map_or_else(Vec::new, |pending| pending.waiting)
    }

    /// Sets the errors of solved frames from `first` on: those of what they decode to.
    pub(crate) fn set_errors(&mut self, first: u32, errors: &[StoredError]) {
        for (frame, error) in (first..).zip(errors) {
            if let Some(entry) = self.solved.get_mut(&frame) {
                (entry.l2, entry.linf, entry.squared, entry.spread) =
                    (error.l2, error.linf, error.squared, error.spread);
            }
        }
    }

    /// Whether the entry adds to what is known: a new frame, or the errors of one that was not measured.
    pub(crate) fn adds_information(&self, entry: &FrameEntry) -> bool {
        self.solved.get(&entry.frame).is_none_or(|known| known.full_digest.is_none() && entry.full_digest.is_some())
    }

    /// Whether a stored frame has the content that pending uploads sent; true if none is pending.
    pub(crate) fn matches_pending(&self, entry: &FrameEntry) -> bool {
        self.pending.get(&entry.frame).is_none_or(|pending| pending.digests.agree(&Digests::of(entry)))
    }

    /// Removes a pending frame that could not be solved or written; returns the uploads that wait for it.
    pub(crate) fn release_claim(&mut self, frame: u32) -> Vec<Arc<Upload>> {
        self.pending.remove(&frame).map_or_else(Vec::new, |pending| pending.waiting)
    }

    /// The entry of a solved frame.
    pub(crate) fn entry(&self, frame: u32) -> Option<&FrameEntry> {
        self.solved.get(&frame)
    }

    /// All solved frames, ascending.
    pub(crate) fn entries(&self) -> impl ExactSizeIterator<Item = &FrameEntry> {
        self.solved.values()
    }

    /// Solved frames from `first` on, ascending.
    pub(crate) fn entries_from(&self, first: u32) -> impl Iterator<Item = &FrameEntry> {
        self.solved.range(first..).map(|(_, entry)| entry)
    }

    /// Up to `most` entries of consecutive frames from `first` on.
    pub(crate) fn run(&self, first: u32, most: usize) -> Vec<FrameEntry> {
        self.solved
            .range(first..)
            .zip(u64::from(first)..)
            .take(most)
            .take_while(|((frame, _), expected)| u64::from(**frame) == *expected)
            .map(|((_, entry), _)| *entry)
            .collect()
    }

    /// Number of consecutive solved frames from `first` on.
    pub(crate) fn run_length(&self, first: u32) -> u64 {
        self.runs.get(&u64::from(first)).map_or(0, |run| run.end - u64::from(first))
    }

    /// Number of solved frames.
    pub(crate) fn solved_count(&self) -> u64 {
        self.solved.len() as u64
    }

    /// Number of frames that are solved or being solved.
    pub(crate) fn received_count(&self) -> u64 {
        self.solved_count() + self.pending.keys().filter(|frame| !self.solved.contains_key(frame)).count() as u64
    }

    /// Whether no frame is solved or being solved.
    pub(crate) fn is_empty(&self) -> bool {
        self.solved.is_empty() && self.pending.is_empty()
    }

    /// Whether any are being solved or written.
    pub(crate) fn is_pending(&self) -> bool {
        !self.pending.is_empty()
    }

    /// The highest solved frame.
    pub(crate) fn highest(&self) -> Option<u32> {
        self.solved.last_key_value().map(|(frame, _)| *frame)
    }

    /// At most `most` ranges of unsolved frames in `from..end`; `end` defaults to the highest solved frame.
    pub(crate) fn missing(&self, from: u32, end: Option<u32>, most: usize) -> Missing {
        let span = u64::from(from)..u64::from(end.or(self.highest()).unwrap_or(0));
        if span.is_empty() {
            return Missing::default();
        }
        let gaps = self.runs.gaps(&span).map(|gap| [gap.start as u32, gap.end as u32]);
        let mut ranges: Vec<[u32; 2]> = gaps.take(most + 1).collect();
        let next = if ranges.len() > most { ranges.pop() } else { None };
        Missing { ranges, next: next.map(|[first, _]| first) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn entry(frame: u32) -> FrameEntry {
        let error = StoredError { l2: 0.0, linf: 0.0, squared: 0.0, spread: 0.0 };
        Digests { handles: [1; 16], full: Some([2; 16]) }.entry(frame, &error)
    }

    #[test]
    fn missing_ranges_lie_between_the_frames_that_are_there() {
        let frames = Frames::new([3, 4, 7].map(entry).to_vec());
        assert_eq!(frames.missing(0, None, 9).ranges, [[0, 3], [5, 7]]);
        assert_eq!(frames.missing(0, Some(10), 9).ranges, [[0, 3], [5, 7], [8, 10]]);
        assert_eq!(frames.missing(0, Some(4), 9).ranges, [[0, 3]]);
        assert_eq!(Frames::default().missing(0, Some(2), 9).ranges, [[0, 2]]);
        assert!(Frames::default().missing(0, None, 9).ranges.is_empty());
        assert_eq!(frames.missing(4, Some(4), 9), Missing::default());
        assert_eq!(frames.missing(1, Some(10), 2), Missing { ranges: vec![[1, 3], [5, 7]], next: Some(8) });
        let highest = Frames::new([u32::MAX - 1, u32::MAX].map(entry).to_vec());
        assert_eq!(highest.missing(5, None, 9).ranges, [[5, u32::MAX - 1]]);
        assert_eq!(highest.missing(u32::MAX, None, 9), Missing::default());
        let mut frames = Frames::new((0..9).map(entry).collect());
        frames.discard_from(4);
        assert_eq!((frames.run_length(2), frames.run_length(4), frames.highest()), (2, 0, Some(3)));
        frames.solved(entry(5));
        assert_eq!(frames.missing(0, Some(7), 9).ranges, [[4, 5], [6, 7]]);
    }

    #[test]
    fn a_run_ends_at_the_first_gap() {
        let frames = Frames::new([3, 4, 5, 7].map(entry).to_vec());
        assert_eq!(frames.run(3, 10).len(), 3);
        assert_eq!(frames.run(4, 1).len(), 1);
        assert_eq!(frames.run_length(4), 2);
        assert!(frames.run(0, 10).is_empty());
        assert_eq!(Frames::new(vec![entry(u32::MAX)]).run_length(u32::MAX), 1);
    }

    #[test]
    fn a_frame_posted_again_is_known_by_its_bytes() {
        let upload = Arc::new(Upload::default());
        let mut frames = Frames::new(vec![entry(3)]);
        let same = Digests { handles: [1; 16], full: Some([2; 16]) };
        assert_eq!(frames.claim(3, same, &upload), Claim::Known);
        assert_eq!(frames.claim(3, Digests { full: None, ..same }, &upload), Claim::Known);
        assert_eq!(frames.claim(3, Digests { full: Some([3; 16]), ..same }, &upload), Claim::Conflict);
        assert_eq!(frames.claim(4, same, &upload), Claim::Solve);
        assert_eq!(frames.claim(4, same, &upload), Claim::Waiting);
        assert_eq!(frames.claim(4, Digests { handles: [9; 16], ..same }, &upload), Claim::Conflict);
        assert_eq!(frames.solved(entry(4)).len(), 2);
        assert_eq!(frames.claim(4, same, &upload), Claim::Known);
    }

    #[test]
    fn a_whole_frame_is_measured_after_its_handle_rows() {
        let upload = Arc::new(Upload::default());
        let mut frames = Frames::new(vec![FrameEntry { full_digest: None, ..entry(3) }]);
        let handles = Digests { handles: [1; 16], full: None };
        let whole = Digests { full: Some([2; 16]), ..handles };
        assert_eq!(frames.claim(3, handles, &upload), Claim::Known);
        assert_eq!(frames.claim(3, Digests { handles: [9; 16], ..whole }, &upload), Claim::Conflict);
        assert_eq!(frames.claim(3, whole, &upload), Claim::Measure);
        assert_eq!((frames.solved_count(), frames.received_count()), (1, 1));
        assert_eq!(frames.claim(3, whole, &upload), Claim::Waiting);
        assert_eq!(frames.solved(FrameEntry { l2: 7.0, ..entry(3) }).len(), 2);
        assert_eq!(frames.entry(3).map(|entry| entry.l2), Some(7.0));
        assert_eq!(frames.claim(3, whole, &upload), Claim::Known);
        assert!(!frames.adds_information(&FrameEntry { full_digest: None, ..entry(3) }), "what was measured stays");
        frames.solved(FrameEntry { full_digest: None, ..entry(4) });
        for frame in 0..3 {
            frames.solved(FrameEntry { full_digest: None, ..entry(frame) });
        }
        assert_eq!(frames.claim(2, whole, &upload), Claim::Measure);
        assert_eq!(frames.seal_at(5, false), Err(SealError::Measuring), "its answer has to be in the container");
        frames.solved(entry(2));
        assert_eq!(frames.seal_at(5, false), Ok(false));
        frames.unseal();
        frames.seal();
        assert_eq!(frames.claim(4, whole, &upload), Claim::Known, "the container must not change");
    }

    #[test]
    fn a_sealed_session_takes_what_it_knows_and_nothing_new() {
        let upload = Arc::new(Upload::default());
        let same = Digests { handles: [1; 16], full: Some([2; 16]) };
        let mut frames = Frames::new([0, 2].map(entry).to_vec());
        assert_eq!(frames.seal_at(3, false), Err(SealError::Missing(Missing { ranges: vec![[1, 2]], next: None })));
        assert_eq!(frames.claim(1, same, &upload), Claim::Solve);
        assert_eq!(
            frames.seal_at(3, false),
            Err(SealError::Missing(Missing { ranges: vec![[1, 2]], next: None })),
            "it is not on disk yet"
        );
        frames.solved(entry(1));
        assert_eq!(frames.seal_at(2, false), Err(SealError::Beyond(2)));
        assert_eq!(frames.seal_at(2, true), Ok(false));
        frames.unseal();
        assert_eq!(frames.claim(3, same, &upload), Claim::Solve);
        assert_eq!(frames.seal_at(3, false), Err(SealError::Beyond(3)), "its record will be sent");
        assert_eq!(frames.seal_at(3, true), Err(SealError::Beyond(3)), "its record will be sent");
        frames.release_claim(3);
        assert_eq!(frames.seal_at(3, false), Ok(false));
        assert_eq!(frames.seal_at(3, false), Ok(true));
        assert_eq!(frames.claim(3, same, &upload), Claim::Sealed);
        assert_eq!(frames.claim(2, same, &upload), Claim::Known);
        frames.unseal();
        assert_eq!(frames.claim(3, same, &upload), Claim::Solve);
    }
}
