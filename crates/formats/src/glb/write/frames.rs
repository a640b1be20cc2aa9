//! The frames that are written, and what they differ from a shape by, block by block.

use std::ops::Range;

use cager_geometry::linalg::BLOCK_ROWS;
use faer::Mat;

/// Numbers of a block.
const BLOCK: usize = 1 << 21;

/// Coordinates of all points, frame after frame.
pub(super) struct Frames<'a> {
    values: &'a [f32],
    /// Of each frame.
    pub(super) length: usize,
    pub(super) count: usize,
}

impl<'a> Frames<'a> {
    pub(super) fn new(values: &'a [f32], points: usize) -> Self {
        Self { values, length: 3 * points, count: values.len() / (3 * points) }
    }

    pub(super) fn mean(&self) -> Vec<f64> {
        let mut mean = vec![0.0; self.length];
        for frame in self.values.chunks_exact(self.length) {
            mean.iter_mut().zip(frame).for_each(|(mean, &x)| *mean += f64::from(x));
        }
        mean.iter_mut().for_each(|mean| *mean /= self.count as f64);
        mean
    }

    /// Differences of coordinates from a shape: a row each, a column for each frame.
    pub(super) fn rows(&self, rows: Range<usize>, shape: &[f64]) -> Mat<f64> {
        let at = |frame: usize, row: usize| f64::from(self.values[frame * self.length + row]) - shape[row];
        Mat::from_fn(rows.len(), self.count, |i, frame| at(frame, rows.start + i))
    }

    /// Ranges of whole points whose rows fill a block.
    pub(super) fn row_blocks(&self) -> impl Iterator<Item = Range<usize>> + use<> {
        let (length, rows) = (self.length, 3 * (BLOCK / self.count / 3).clamp(1, BLOCK_ROWS));
        (0..length).step_by(rows).map(move |first| first..(first + rows).min(length))
    }
}
