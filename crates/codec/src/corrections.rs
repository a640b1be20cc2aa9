//! Single vertices in single frames that are moved to where they were captured, to within a bound.

use crate::entropy::{Coder, Decoder, Encoder, Integers, MAX_SIZE, Models};
use crate::error::{Error, Result};
use rayon::prelude::*;

/// The corrected vertices of a group, frame by frame, in whole steps.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Corrections {
    step: f64,
    frames: Vec<Vec<Correction>>,
}

impl Corrections {
    /// None in any of so many frames.
    pub(crate) fn none(frames: usize, step: f64) -> Self {
        Self { step, frames: vec![Vec::new(); frames] }
    }

    /// Those that take every decoded position to within `bound` of the captured one. `None` where
    /// single precision does not tell such steps apart, or they do not count the distance.
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
        let mut coder = Encoder::default();
        // What is given has as many as it may have.
        if self.count() > 0 && code(&mut coder, &self.frames, self.frames.len(), usize::MAX, usize::MAX).is_ok() {
            return coder.into_bytes();
        }
        Vec::new()
    }

    pub(crate) fn decode(bytes: &[u8], frames: usize, points: usize, step: f64) -> Result<Self> {
        if bytes.is_empty() {
            return Ok(Self::none(frames, step));
        }
        let mut coder = Decoder::new(bytes)?;
        // Past its end a decoder reads zeros, which could stand for any number of them.
        let most = (1 << 20) + 64 * bytes.len();
        let frames = code(&mut coder, &[], frames, points, most)?;
        coder.check()?;
        Ok(Self { step, frames })
    }
}

/// A vertex, and the steps that it is moved.
type Correction = (u32, [i32; 3]);

/// Codes corrections, at most `most`: their number in each frame, vertices passed over, and steps.
fn code(
    coder: &mut impl Coder,
    given: &[Vec<Correction>],
    frames: usize,
    points: usize,
    most: usize,
) -> Result<Vec<Vec<Correction>>> {
    let (mut counts, mut gaps, mut sizes) = (Integers::new(1), Integers::new(1), Integers::new(3));
    let (mut count, mut left) = (0i32, most);
    let mut found = Vec::with_capacity(frames);
    for frame in 0..frames {
        let given = given.get(frame).map_or(&[][..], Vec::as_slice);
        let difference = counts.code(coder, 0, (given.len() as i32).wrapping_sub(count));
        count = count.wrapping_add(difference).max(0);
        coder.check()?;
        let of_frame = count as usize;
        left = left.checked_sub(of_frame).ok_or(Error::Damaged("more corrections than their bytes can say"))?;
        if of_frame > points {
            return Err(Error::Damaged("more corrections than points"));
        }
        let (mut list, mut next) = (Vec::with_capacity(of_frame), 0);
        for k in 0..of_frame {
            let (vertex, steps) = given.get(k).copied().unwrap_or((next as u32, [0; 3]));
            let vertex = next + gaps.natural(coder, 0, vertex - next as u32) as usize;
            if vertex >= points {
                return Err(Error::Damaged("a correction of no point"));
            }
            list.push((vertex as u32, [0, 1, 2].map(|k| sizes.code(coder, k, steps[k]))));
            next = vertex + 1;
        }
        found.push(list);
    }
    Ok(found)
}

fn correct(position: &mut [f32], steps: [i32; 3], step: f64) {
    for k in 0..3 {
        position[k] = (f64::from(position[k]) + f64::from(steps[k]) * step) as f32;
    }
}
