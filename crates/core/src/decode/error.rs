//! Errors of decoded frames, summed over blocks of points.

use crate::simd::multiversion;
use cager_geometry::mesh::Point;
use cager_geometry::vector::add;

/// Errors of one frame against the capture.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FrameError {
    /// `sqrt(mean |e|²)` over the points, in the capture's unit.
    pub l2: f64,
    /// `max |e|`.
    pub linf: f64,
    /// Index of the first point with that error.
    pub worst: u32,
    /// `Σ |e|²`.
    pub squared: f64,
    /// `Σ |p − p̄|²` of the frame about its own centroid.
    pub spread: f64,
}

impl FrameError {
    /// Of decoded positions, points × 3, against those of the capture.
    ///
    /// # Panics
    /// Where there are not as many.
    pub fn of_positions(decoded: &[f32], captured: &[f64]) -> Self {
        assert_eq!(decoded.len(), captured.len(), "every point of the frame");
        let centre: Point = std::array::from_fn(|k| captured.get(k).copied().unwrap_or_default());
        let mut sums = Sums::default();
        for (at, (a, b)) in decoded.chunks_exact(3).zip(captured.chunks_exact(3)).enumerate() {
            let squared = (0..3).map(|k| (f64::from(a[k]) - b[k]).powi(2)).sum::<f64>();
            sums.squared += squared;
            if exceeds(squared, sums.largest) {
                (sums.largest, sums.at) = (squared, at);
            }
            for k in 0..3 {
                let x = b[k] - centre[k];
                sums.first[k] += x;
                sums.second += x * x;
            }
        }
        sums.into_error(decoded.len() / 3)
    }
}

/// Sums over the points of a block.
#[derive(Clone, Copy, Default)]
pub(super) struct Sums {
    squared: f64,
    largest: f64,
    /// Index of the point with that error.
    at: usize,
    /// Sums of the positions about the frame's cage centre, and of their squares.
    first: Point,
    second: f64,
}

impl Sums {
    pub(super) fn total<'a>(parts: impl Iterator<Item = &'a Self>) -> Self {
        parts.fold(Self::default(), |a, b| Self {
            squared: a.squared + b.squared,
            largest: if exceeds(b.largest, a.largest) { b.largest } else { a.largest },
            at: if exceeds(b.largest, a.largest) { b.at } else { a.at },
            first: add(a.first, b.first),
            second: a.second + b.second,
        })
    }

    pub(super) fn into_error(self, points: usize) -> FrameError {
        let n = points as f64;
        let about_mean = self.first.iter().map(|s| s * s).sum::<f64>() / n;
        FrameError {
            l2: (self.squared / n).sqrt(),
            linf: self.largest.sqrt(),
            worst: self.at as u32,
            squared: self.squared,
            spread: (self.second - about_mean).max(0.0),
        }
    }
}

/// Whether an error is larger than the largest before it; NaN is larger than all others.
fn exceeds(error: f64, largest: f64) -> bool {
    error > largest || error.is_nan() && !largest.is_nan()
}

/// Error sums of the points from `first` on; decoded positions are relative to the cage's centre.
pub(super) fn block_sums<T: Copy + Into<f64>>(columns: [&[f32]; 3], part: &[T], centre: Point, first: usize) -> Sums {
    const STRIP: usize = 64;
    let mut sums = Sums::default();
    let mut strip = [[0.0; STRIP]; 3];
    for (s, points) in part.chunks(3 * STRIP).enumerate() {
        for (i, p) in points.chunks_exact(3).enumerate() {
            strip[0][i] = p[0].into();
            strip[1][i] = p[1].into();
            strip[2][i] = p[2].into();
        }
        let count = points.len() / 3;
        let here = columns.map(|c| &c[s * STRIP..][..count]);
        let there = [&strip[0][..count], &strip[1][..count], &strip[2][..count]];
        let before = sums.largest;
        strip_sums(here, there, &centre, &mut sums);
        if exceeds(sums.largest, before) {
            sums.at = first + s * STRIP + largest(here, there, &centre);
        }
    }
    sums
}

/// The first point of a strip whose error is the largest.
fn largest(decoded: [&[f32]; 3], truth: [&[f64]; 3], centre: &Point) -> usize {
    let squared = |i: usize| {
        let error = |k: usize| f64::from((f64::from(decoded[k][i]) + centre[k]) as f32) - truth[k][i];
        (0..3).map(|k| error(k).powi(2)).sum::<f64>()
    };
    (1..decoded[0].len()).fold(0, |best, i| if exceeds(squared(i), squared(best)) { i } else { best })
}

multiversion! {
    fn strip_sums(decoded: [&[f32]; 3], truth: [&[f64]; 3], centre: &Point, sums: &mut Sums) {
        const WIDE: usize = 8;
        let mut squared = [0.0f64; WIDE];
        let mut largest = [0.0f64; WIDE];
        let mut second = [0.0f64; WIDE];
        let mut first = [[0.0f64; WIDE]; 3];
        let count = decoded[0].len();
        let mut start = 0;
        while start < count {
            let width = WIDE.min(count - start);
            let mut e2 = [0.0f64; WIDE];
            for k in 0..3 {
                let mut d = [0.0f32; WIDE];
                let mut t = [0.0f64; WIDE];
                d[..width].copy_from_slice(&decoded[k][start..start + width]);
                t[..width].copy_from_slice(&truth[k][start..start + width]);
                for l in 0..WIDE {
                    let used = if l < width { 1.0 } else { 0.0 };
                    // Rounded as a decoder's output is.
                    let out = f64::from((f64::from(d[l]) + centre[k]) as f32);
                    let e = (out - t[l]) * used;
                    e2[l] += e * e;
                    let about = (t[l] - centre[k]) * used;
                    first[k][l] += about;
                    second[l] += about * about;
                }
            }
            for l in 0..WIDE {
                squared[l] += e2[l];
                largest[l] = if e2[l] > largest[l] { e2[l] } else { largest[l] };
            }
            start += width;
        }
        for l in 0..WIDE {
            sums.squared += squared[l];
            // The sum is NaN where one of its terms is.
            let largest = if squared[l].is_nan() { f64::NAN } else { largest[l] };
            sums.largest = if exceeds(largest, sums.largest) { largest } else { sums.largest };
            sums.second += second[l];
            for k in 0..3 {
                sums.first[k] += first[k][l];
            }
        }
    }
}
