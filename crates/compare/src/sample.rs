//! Which frames are measured, and how they come one after another.

use cager_formats::{Error, FrameReader};

/// Frames to measure: all of a short capture, evenly spaced ones of a long one, each with its
/// neighbours for differences in time.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Sample {
    /// Ascending.
    measured: Vec<usize>,
    frames: usize,
}

/// A frame that has been read.
#[derive(Clone, Debug)]
pub(crate) struct Frame {
    /// Its number, from 0.
    pub(crate) number: usize,
    /// Whether its error is measured; otherwise it only serves for differences in time.
    pub(crate) measured: bool,
    /// Points, n × 3 interleaved.
    pub(crate) points: Vec<f64>,
}

impl Sample {
    /// Of a capture of `frames` frames, `most` at the most.
    pub(crate) fn new(frames: usize, most: usize) -> Self {
        let count = frames.min(most.max(1));
        let measured = match count {
            0 | 1 => (0..count).collect(),
            _ => (0..count).map(|k| (k * (frames - 1) + (count - 1) / 2) / (count - 1)).collect(),
        };
        Self { measured, frames }
    }

    /// Some of the frames measured, evenly spaced: `most` at the most.
    pub(crate) fn some(&self, most: usize) -> Self {
        let places = Self::new(self.measured.len(), most).measured;
        Self { measured: places.into_iter().map(|place| self.measured[place]).collect(), frames: self.frames }
    }

    pub(crate) fn measured(&self) -> &[usize] {
        &self.measured
    }

    /// Whether every frame is measured.
    pub(crate) fn is_complete(&self) -> bool {
        self.measured.len() == self.frames
    }

    /// Position of a frame among the measured ones.
    pub(crate) fn position(&self, frame: usize) -> Option<usize> {
        self.measured.binary_search(&frame).ok()
    }

    /// Whether a frame is measured, or the neighbour of one that is.
    pub(crate) fn needed(&self, frame: usize) -> bool {
        (frame.saturating_sub(1)..=frame + 1).any(|f| self.position(f).is_some())
    }

    /// Frames to be read to the end of the last that is needed.
    pub(crate) fn to_read(&self) -> usize {
        self.measured.last().map_or(0, |last| (last + 2).min(self.frames))
    }

    /// Fills `batch` with up to `size` of the next needed frames; it stays empty at the end. `next`
    /// is the number of the reader's next frame.
    pub(crate) fn fill(
        &self,
        reader: &mut dyn FrameReader,
        next: &mut usize,
        size: usize,
        batch: &mut Vec<Frame>,
    ) -> Result<(), Error> {
        let mut spare: Vec<Vec<f64>> = batch.drain(..).map(|frame| frame.points).collect();
        while batch.len() < size && *next < self.to_read() {
            let mut points = spare.pop().unwrap_or_default();
            if !reader.read_next(&mut points)? {
                break;
            }
            let number = *next;
            *next += 1;
            if self.needed(number) {
                batch.push(Frame { number, measured: self.position(number).is_some(), points });
            } else {
                spare.push(points);
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sample_is_even_and_has_both_ends() {
        assert_eq!(Sample::new(5, 120).measured(), [0, 1, 2, 3, 4]);
        assert_eq!(Sample::new(101, 5).measured(), [0, 25, 50, 75, 100]);
        assert_eq!(Sample::new(7, 1).measured(), [0]);
        assert_eq!(Sample::new(1, 120).measured(), [0]);
        let long = Sample::new(10_000, 120);
        let gaps: Vec<usize> = long.measured().windows(2).map(|w| w[1] - w[0]).collect();
        assert_eq!((long.measured().len(), long.measured()[119]), (120, 9_999));
        assert!(gaps.iter().all(|gap| (84..=85).contains(gap)), "{gaps:?}");
    }

    #[test]
    fn measured_frames_come_with_their_neighbours() {
        let sample = Sample::new(101, 3);
        let needed: Vec<usize> = (0..101).filter(|&f| sample.needed(f)).collect();
        assert_eq!(needed, [0, 1, 49, 50, 51, 99, 100]);
        assert_eq!((sample.to_read(), Sample::new(100, 1).to_read()), (101, 2));
    }

    #[test]
    fn some_of_a_sample_are_among_it() {
        let sample = Sample::new(1000, 50);
        let some = sample.some(6);
        assert_eq!(some.measured().len(), 6);
        assert!(some.measured().iter().all(|&frame| sample.position(frame).is_some()));
        assert_eq!((some.measured()[0], some.measured()[5]), (0, 999));
        assert_eq!(Sample::new(4, 120).some(6), Sample::new(4, 120));
    }
}
