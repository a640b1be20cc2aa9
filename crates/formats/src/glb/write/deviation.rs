//! How far frames are from what morph targets make of them.

use faer::{Mat, MatRef};
use rayon::prelude::*;

/// How far what is written is from the frames.
#[derive(Clone, Debug, Default)]
pub(crate) struct Deviation {
    pub(crate) targets: usize,
    pub(crate) largest: f64,
    /// The root of the mean squared distance over all points and frames.
    pub(crate) rms: f64,
    pub(crate) diagonal: f64,
}

impl Deviation {
    /// Of the diagonal.
    pub(crate) fn share(&self, distance: f64) -> f64 {
        if distance == 0.0 { 0.0 } else { distance / self.diagonal }
    }
}

/// Errors of the first targets, for several numbers of targets.
pub(super) struct Errors {
    /// The smallest of these.
    first_level: usize,
    /// By frame and number of targets: the largest squared distance of a point, and the sum of all.
    frames: Vec<Vec<[f64; 2]>>,
}

impl Errors {
    /// For so many targets at least and at most.
    pub(super) fn new(first_level: usize, last_level: usize, frames: usize) -> Self {
        Self { first_level, frames: vec![vec![[0.0; 2]; last_level + 1 - first_level]; frames] }
    }

    /// Adds points of all frames: differences from the base, what targets move by, and weights.
    pub(super) fn add(&mut self, differences: &Mat<f64>, shapes: &Mat<f64>, weights: MatRef<'_, f64>) {
        let first_level = self.first_level;
        self.frames.par_iter_mut().enumerate().for_each(|(frame, levels)| {
            let mut rest = differences.col_as_slice(frame).to_vec();
            for k in 0..=shapes.ncols() {
                if let Some(level) = k.checked_sub(first_level) {
                    let squared = rest.as_chunks().0.iter().map(|&[x, y, z]| x * x + y * y + z * z);
                    let [largest, sum] = &mut levels[level];
                    (*largest, *sum) = squared.fold((*largest, *sum), |(most, sum), x: f64| (most.max(x), sum + x));
                }
                if k < shapes.ncols() {
                    let weight = weights[(frame, k)];
                    rest.iter_mut().zip(shapes.col_as_slice(k)).for_each(|(rest, &x)| *rest -= weight * x);
                }
            }
        });
    }

    /// By number of targets, the fewest first.
    pub(super) fn deviations(&self, points: usize, diagonal: f64) -> impl Iterator<Item = Deviation> {
        let levels = self.frames.first().map_or(0, Vec::len);
        (0..levels).map(move |level| {
            let frames = self.frames.iter().map(|levels| levels[level]);
            let [largest, sum] = frames.fold([0.0_f64, 0.0], |[most, sum], [x, y]| [most.max(x), sum + y]);
            let rms = (sum / (points * self.frames.len()) as f64).sqrt();
            Deviation { targets: self.first_level + level, largest: largest.sqrt(), rms, diagonal }
        })
    }
}
