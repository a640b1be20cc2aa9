//! Ranges of frames: from one to another, with a step.

use std::fmt;
use std::ops::Range;
use std::path::Path;
use std::str::FromStr;

use cager_geometry::mesh::Polygons;
use cager_geometry::surface::shown_in;
use cager_geometry::units::Units;

use super::{FrameReader, PictureSequence};
use crate::error::{Error, Fault};

/// Frames `first` to `last`, both included, every `step`-th of them, counted from 0 in the order of
/// their source. Written `A-B` or `A-BxSTEP`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FrameRange {
    first: usize,
    last: usize,
    step: usize,
}

impl FrameRange {
    /// A single frame.
    pub fn only(frame: usize) -> Self {
        Self { first: frame, last: frame, step: 1 }
    }

    /// All of so many frames, at least one.
    pub fn all(frames: usize) -> Self {
        Self { first: 0, last: frames.saturating_sub(1), step: 1 }
    }

    /// How many frames these are.
    pub fn count(&self) -> usize {
        (self.last - self.first) / self.step + 1
    }

    /// The frame at a place among these.
    pub fn frame(&self, place: usize) -> usize {
        self.first + place * self.step
    }

    /// Those of these that are among `frames` frames from `start` on, counted from there.
    pub fn part(&self, start: usize, frames: usize) -> Option<Self> {
        let skipped = start.saturating_sub(self.first).div_ceil(self.step);
        let first = skipped.checked_mul(self.step).and_then(|steps| self.first.checked_add(steps))?;
        let last = self.last.min(start.checked_add(frames)?.checked_sub(1)?);
        (first <= last).then(|| Self { first: first - start, last: last - start, step: self.step })
    }

    /// Whether all of these are among `frames` frames of `source`, which have these numbers.
    ///
    /// # Errors
    /// [`Error::Invalid`] with the frames that there are; of numbers, the frames that have them.
    pub fn check(&self, frames: usize, number: impl Fn(usize) -> f64, source: &Path) -> Result<(), Error> {
        if self.last < frames {
            return Ok(());
        }
        if let Some(places) = self.of_numbers(frames, &number) {
            let are = if self.first == self.last { "number" } else { "numbers" };
            let (own, is) = (self.bounds(), if self.first == self.last { "is" } else { "are" });
            return Err(Fault::invalid(format!(
                "frames are counted from 0 here, 0 to {}, and {are} {own} {is} {places}; give {}",
                frames - 1,
                places.bounds()
            ))
            .at(source));
        }
        let numbered = || {
            let (first, last) = (number(0), number(frames - 1));
            if (first, last) == (0.0, (frames - 1) as f64) {
                String::new()
            } else {
                let step = number(1.min(frames - 1)) - first;
                let is_even = (1..frames).all(|k| number(k) - number(k - 1) == step);
                let steps = if is_even && step > 1.0 { format!(" in steps of {step}") } else { String::new() };
                format!(", with the numbers {first} to {last}{steps}")
            }
        };
        let there = match frames {
            0 => "has no frames".to_owned(),
            1 => "has one frame, frame 0".to_owned(),
            _ => format!("has frames 0 to {}{}", frames - 1, numbered()),
        };
        Err(Fault::invalid(format!("{there}, so {self} cannot be taken from it; give frames that it has")).at(source))
    }

    /// What is to be said of these frames where they have other numbers than their places.
    pub fn numbered(&self, number: impl Fn(usize) -> f64) -> Option<String> {
        let [first, last] = [self.frame(0), self.frame(self.count() - 1)];
        let [from, to] = [number(first), number(last)];
        let differ = [from, to] != [first as f64, last as f64];
        let one = || format!("{self}, counted from 0, has the number {from}");
        let several = || format!("{self}, counted from 0, have the numbers {from} to {to}");
        differ.then(|| if first == last { one() } else { several() })
    }

    /// The frames that have these numbers, where all of them are numbers of frames, evenly spaced.
    fn of_numbers(&self, frames: usize, number: &impl Fn(usize) -> f64) -> Option<Self> {
        let mut wanted = (0..self.count()).map(|k| self.frame(k) as f64);
        let mut places = Vec::new();
        let mut next = wanted.next();
        for place in 0..frames {
            if next == Some(number(place)) {
                places.push(place);
                next = wanted.next();
            }
        }
        let (&first, &last) = (places.first()?, places.last()?);
        let step = places.get(1).map_or(1, |second| second - first);
        let is_even = places.windows(2).all(|pair| pair[1] - pair[0] == step);
        (next.is_none() && is_even).then_some(Self { first, last, step })
    }

    /// As it is written.
    fn bounds(&self) -> String {
        match (self.first == self.last, self.step) {
            (true, _) => self.first.to_string(),
            (false, 1) => format!("{}-{}", self.first, self.last),
            (false, step) => format!("{}-{}x{step}", self.first, self.last),
        }
    }
}

impl fmt::Display for FrameRange {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let frames = if self.first == self.last { "frame" } else { "frames" };
        write!(f, "{frames} {}", self.bounds())
    }
}

impl FromStr for FrameRange {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (bounds, step) = text.split_once('x').unwrap_or((text, "1"));
        let numbers = bounds.split_once('-').and_then(|(first, last)| {
            Some(Self { first: first.parse().ok()?, last: last.parse().ok()?, step: step.parse().ok()? })
        });
        match numbers {
            None => Err("write it as A-B or A-BxSTEP, such as 0-99 or 10-50x2; frames are counted from 0".to_owned()),
            Some(range) if range.last < range.first => {
                Err(format!("frame {} comes after frame {}; write the smaller number first", range.first, range.last))
            }
            Some(range) if range.step == 0 => Err("a step of 0 never ends; give 1 or more".to_owned()),
            Some(range) => Ok(range),
        }
    }
}

/// The frames of a range.
pub(super) struct RangeReader {
    reader: Box<dyn FrameReader>,
    range: FrameRange,
    /// How many of the range were read or skipped.
    taken: usize,
    /// The frame that the reader gives next.
    at: usize,
    /// What the frames are called in the source, where they have other numbers there.
    note: Option<String>,
}

impl RangeReader {
    /// The frames of a range, where one is given, of those of a source.
    pub(super) fn open(
        reader: Box<dyn FrameReader>,
        range: Option<FrameRange>,
        source: &Path,
    ) -> Result<Box<dyn FrameReader>, Error> {
        let Some(range) = range else { return Ok(reader) };
        range.check(reader.frames(), |frame| reader.number(frame), source)?;
        let note = range.numbered(|frame| reader.number(frame)).filter(|_| !reader.numbers_are_times());
        let note = note.map(|note| format!("{}: {note}", source.display()));
        Ok(Box::new(Self { reader, range, taken: 0, at: 0, note }))
    }

    /// Moves the reader to the next frame of the range; false at the end.
    fn advance(&mut self) -> Result<bool, Error> {
        if self.taken == self.range.count() {
            return Ok(false);
        }
        while self.at < self.range.frame(self.taken) {
            if !self.reader.skip()? {
                return Ok(false);
            }
            self.at += 1;
        }
        Ok(true)
    }

    fn took(&mut self, more: bool) -> bool {
        self.at += usize::from(more);
        self.taken += usize::from(more);
        more
    }
}

impl FrameReader for RangeReader {
    fn points(&self) -> usize {
        self.reader.points()
    }

    fn frames(&self) -> usize {
        self.range.count()
    }

    fn frame_rate(&self) -> Option<f64> {
        self.reader.frame_rate()
    }

    /// The numbers of the source, so that the timing of the remaining frames is unchanged.
    fn number(&self, frame: usize) -> f64 {
        self.reader.number(self.range.frame(frame))
    }

    fn numbers_are_times(&self) -> bool {
        self.reader.numbers_are_times()
    }

    fn notes(&self) -> Vec<String> {
        self.reader.notes().into_iter().chain(self.note.clone()).collect()
    }

    fn units(&self) -> Units {
        self.reader.units()
    }

    fn shown(&self) -> Vec<Option<Vec<Range<u32>>>> {
        let frames = || (0..self.range.count()).map(|place| self.range.frame(place) as u32);
        let taken =
            |shown: Vec<Range<u32>>| shown_in(frames().map(|frame| shown.iter().any(|range| range.contains(&frame))));
        self.reader.shown().into_iter().map(|shown| shown.and_then(taken)).collect()
    }

    fn pictures(&self) -> Vec<PictureSequence> {
        let mut found = self.reader.pictures();
        for PictureSequence { paths, .. } in &mut found {
            let taken = (0..self.range.count()).filter_map(|place| paths.get(self.range.frame(place)));
            *paths = taken.cloned().collect();
        }
        found
    }

    fn mesh(&self) -> Option<(&Path, &Polygons)> {
        self.reader.mesh()
    }

    fn read_next(&mut self, out: &mut Vec<f64>) -> Result<bool, Error> {
        if !self.advance()? {
            out.clear();
            return Ok(false);
        }
        let more = self.reader.read_next(out)?;
        Ok(self.took(more))
    }

    fn skip(&mut self) -> Result<bool, Error> {
        let more = self.advance()? && self.reader.skip()?;
        Ok(self.took(more))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_range_has_a_part_in_each_stretch_of_frames() {
        let range: FrameRange = "3-17x4".parse().unwrap();
        let taken = |part: Option<FrameRange>| {
            part.map(|part| (0..part.count()).map(|place| part.frame(place)).collect::<Vec<_>>()).unwrap_or_default()
        };
        for cuts in [[0, 8, 20], [0, 3, 18], [0, 4, 6], [0, 0, 20], [0, 15, 16]] {
            let mut all = Vec::new();
            for (start, end) in [(cuts[0], cuts[1]), (cuts[1], cuts[2]), (cuts[2], 30)] {
                all.extend(taken(range.part(start, end - start)).iter().map(|frame| start + frame));
            }
            assert_eq!(all, [3, 7, 11, 15], "{cuts:?}");
        }
        assert_eq!(taken(range.part(4, 3)), Vec::<usize>::new());
    }

    #[test]
    fn numbers_that_are_no_frames_are_told_by_the_frames_that_have_them() {
        let told = |range: &str, frames: usize, number: &dyn Fn(usize) -> f64| {
            let range: FrameRange = range.parse().unwrap();
            range.check(frames, number, Path::new("shot")).map_err(|error| error.to_string())
        };
        let from_1001 = |place: usize| 1001.0 + place as f64;
        let counted = "shot: frames are counted from 0 here, 0 to 5, and ";
        for (range, what) in [
            ("1003-1003", "number 1003 is frame 2; give 2"),
            ("1003-1005", "numbers 1003-1005 are frames 2-4; give 2-4"),
            ("1001-1006x2", "numbers 1001-1006x2 are frames 0-4x2; give 0-4x2"),
        ] {
            assert_eq!(told(range, 6, &from_1001), Err(format!("{counted}{what}")));
        }
        let error = told("1003-1009", 6, &from_1001).unwrap_err();
        assert!(error.contains("has frames 0 to 5, with the numbers 1001 to 1006, so frames 1003-1009"), "{error}");
        // Every second frame of a shot.
        let twos = |place: usize| 1001.0 + 2.0 * place as f64;
        assert!(told("1003-1007x2", 6, &twos).unwrap_err().contains("are frames 1-3; give 1-3"));
        let error = told("1003-1007", 6, &twos).unwrap_err();
        assert!(
            error.contains("the numbers 1001 to 1011 in steps of 2, so") && error.contains("give frames"),
            "{error}"
        );
        assert_eq!(told("2-4", 6, &from_1001), Ok(()));
        let note = |range: &str, number: &dyn Fn(usize) -> f64| range.parse::<FrameRange>().unwrap().numbered(number);
        assert_eq!(note("2-4", &|place| place as f64), None);
        assert_eq!(note("9-9", &|place| 1.0 + place as f64).unwrap(), "frame 9, counted from 0, has the number 10");
        assert_eq!(note("2-5x2", &from_1001).unwrap(), "frames 2-5x2, counted from 0, have the numbers 1003 to 1005");
    }

    #[test]
    fn ranges_are_read_as_they_are_written() {
        let range: FrameRange = "3-10x3".parse().unwrap();
        assert_eq!((range.count(), range.frame(0), range.frame(2)), (3, 3, 9));
        assert_eq!(range.to_string(), "frames 3-10x3");
        assert_eq!("7-7".parse(), Ok(FrameRange::only(7)));
        assert_eq!("0-4".parse(), Ok(FrameRange::all(5)));
        for wrong in ["", "3", "a-b", "3-", "-3", "5-3", "0-9x0", "0-9x", "0-9x-1", "0--9"] {
            assert!(wrong.parse::<FrameRange>().is_err(), "{wrong}");
        }
    }
}
