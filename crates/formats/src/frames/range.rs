//! Ranges of frames: from one to another, with a step.

use std::fmt;
use std::path::Path;
use std::str::FromStr;

use cager_geometry::mesh::Polygons;
use cager_geometry::units::Units;

use super::FrameReader;
use crate::error::{Error, Fault};

/// Frames `first` to `last`, both included, every `step`-th of them, counted from 0 in the order of their source. Written
/// `A-B` or `A-BxSTEP`.
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

    /// Whether there are all of these among `frames` frames of `source`.
    ///
    /// # Errors
    /// [`Error::Invalid`] with the frames that there are.
    pub fn check(&self, frames: usize, source: &Path) -> Result<(), Error> {
        if self.last < frames {
            return Ok(());
        }
        let there = match frames {
            0 => "has no frames".to_owned(),
            1 => "has one frame, frame 0".to_owned(),
            _ => format!("has frames 0 to {}", frames - 1),
        };
        Err(Fault::invalid(format!("{there}, so {self} cannot be taken from it; give frames that it has")).at(source))
    }
}

impl fmt::Display for FrameRange {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match (self.first == self.last, self.step) {
            (true, _) => write!(f, "frame {}", self.first),
            (false, 1) => write!(f, "frames {}-{}", self.first, self.last),
            (false, step) => write!(f, "frames {}-{}x{step}", self.first, self.last),
        }
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
}

impl RangeReader {
    /// The frames of a range, where one is given, of those of a source.
    pub(super) fn open(
        reader: Box<dyn FrameReader>,
        range: Option<FrameRange>,
        source: &Path,
    ) -> Result<Box<dyn FrameReader>, Error> {
        let Some(range) = range else { return Ok(reader) };
        range.check(reader.frames(), source)?;
        Ok(Box::new(Self { reader, range, taken: 0, at: 0 }))
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
        self.reader.notes()
    }

    fn units(&self) -> Units {
        self.reader.units()
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
