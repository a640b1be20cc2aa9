//! Single vertices in single frames that are moved to where they were captured, to within a bound.

use crate::entropy::{Coder, Decoder, Encoder, Integers, MAX_SIZE};
use crate::error::{Error, Result};
use rayon::prelude::*;

/// The corrected vertices of a group, frame by frame, in whole steps.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Corrections {
    step: f64,
    frames: Vec<Vec<(u32, [i32; 3])>>,
}

impl Corrections {
    /// None in any of so many frames.
    pub(crate) fn none(frames: usize, step: f64) -> Self {
        Self { step, frames: vec![Vec::new(); frames] }
    }

    /// Those that take every decoded position, points × 3, to within `bound` of the captured one. `None` where steps of this bound cannot be told
    /// apart in single precision, or do not count the distance.
    pub(crate) fn find(captured: &[&[f64]], decoded: &[Vec<f32>], bound: f64) -> Option<Self> {
        let farthest = captured.iter().flat_map(|frame| frame.iter()).fold(0.0f64, |far, x| far.max(x.abs()));
        // Half a step along each axis, and rounding, are less than the bound.
        let step = 1.96 * (bound - 0.9 * f64::from(f32::EPSILON) * farthest) / 3.0f64.sqrt();
        if step.is_nan() || step <= 0.0 {
            return None;
        }
        let of_frame = |(captured, decoded): (&&[f64], &Vec<f32>)| {
            let mut found = Vec::new();
            for (vertex, (a, b)) in captured.chunks_exact(3).zip(decoded.chunks_exact(3)).enumerate() {
                let far = |b: &[f32]| {
                    let squared: f64 = (0..3).map(|k| (a[k] - f64::from(b[k])).powi(2)).sum();
                    squared.is_nan() || squared > bound * bound
                };
                if far(b) {
                    let steps: [f64; 3] = std::array::from_fn(|k| ((a[k] - f64::from(b[k])) / step).round());
                    if steps.iter().any(|x| x.is_nan() || x.abs() > f64::from(MAX_SIZE)) {
                        return None;
                    }
                    let steps = steps.map(|x| x as i32);
                    let mut moved = [b[0], b[1], b[2]];
                    correct(&mut moved, steps, step);
                    if far(&moved) {
                        return None;
                    }
                    found.push((vertex as u32, steps));
                }
            }
            Some(found)
        };
        let frames = captured.par_iter().zip(decoded).map(of_frame).collect::<Option<_>>()?;
        Some(Self { step, frames })
    }

    /// The unit of the corrections.
    pub(crate) fn step(&self) -> f64 {
        self.step
    }

    /// Number of corrected positions.
    pub(crate) fn count(&self) -> usize {
        self.frames.iter().map(Vec::len).sum()
    }

    /// Moves the corrected vertices of a frame.
    pub(crate) fn apply(&self, frame: usize, positions: &mut [f32]) {
        for &(vertex, steps) in self.frames.get(frame).into_iter().flatten() {
            correct(&mut positions[3 * vertex as usize..][..3], steps, self.step);
        }
    }

    /// Nothing where nothing is corrected.
    pub(crate) fn encode(&self) -> Vec<u8> {
        if self.count() == 0 {
            return Vec::new();
        }
        let mut coder = Encoder::default();
        let mut models = Models::new();
        for frame in &self.frames {
            models.count(&mut coder, frame.len() as u32);
            let mut next = 0;
            for &(vertex, steps) in frame {
                models.correction(&mut coder, vertex - next, steps);
                next = vertex + 1;
            }
        }
        coder.into_bytes()
    }

    pub(crate) fn decode(bytes: &[u8], frames: usize, points: usize, step: f64) -> Result<Self> {
        if bytes.is_empty() {
            return Ok(Self::none(frames, step));
        }
        let mut coder = Decoder::new(bytes)?;
        let mut models = Models::new();
        let mut found = Vec::with_capacity(frames);
        // Past its end a decoder reads zeros, which could stand for any number of them.
        let mut left = (1 << 20) + 64 * bytes.len();
        for _ in 0..frames {
            let count = models.count(&mut coder, 0) as usize;
            coder.check()?;
            left = left.checked_sub(count).ok_or(Error::Damaged("more corrections than their bytes can say"))?;
            if count > points {
                return Err(Error::Damaged("more corrections than points"));
            }
            let mut frame = Vec::with_capacity(count);
            let mut next = 0usize;
            for _ in 0..count {
                let (gap, steps) = models.correction(&mut coder, 0, [0; 3]);
                let vertex = next + gap as usize;
                if vertex >= points {
                    return Err(Error::Damaged("a correction of no point"));
                }
                frame.push((vertex as u32, steps));
                next = vertex + 1;
            }
            found.push(frame);
        }
        coder.check()?;
        Ok(Self { step, frames: found })
    }
}

fn correct(position: &mut [f32], steps: [i32; 3], step: f64) {
    for k in 0..3 {
        position[k] = (f64::from(position[k]) + f64::from(steps[k]) * step) as f32;
    }
}

struct Models {
    counts: Integers,
    gaps: Integers,
    steps: Integers,
    last_count: u32,
}

impl Models {
    fn new() -> Self {
        Self { counts: Integers::new(1), gaps: Integers::new(2), steps: Integers::new(3), last_count: 0 }
    }

    fn count(&mut self, coder: &mut impl Coder, value: u32) -> u32 {
        let difference = self.counts.code(coder, 0, (value as i32).wrapping_sub(self.last_count as i32));
        self.last_count = (self.last_count as i32).wrapping_add(difference).max(0) as u32;
        self.last_count
    }

    fn correction(&mut self, coder: &mut impl Coder, gap: u32, steps: [i32; 3]) -> (u32, [i32; 3]) {
        let gap = self.gaps.natural(coder, 0, gap);
        let mut found = [0; 3];
        for k in 0..3 {
            found[k] = self.steps.code(coder, k, steps[k]);
        }
        (gap, found)
    }
}
