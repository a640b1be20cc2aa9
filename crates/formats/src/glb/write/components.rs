//! Principal components of frames, by eigenvectors of their Gram matrix (the method of snapshots:
//! Sirovich, "Turbulence and the dynamics of coherent structures", 1987).

use std::ops::Range;

use cager_geometry::linalg::{BLOCK_ROWS, eigen, gram, mirrored, multiply};
use cager_geometry::mesh::diagonal;
use faer::Mat;

use super::deviation::{Deviation, Errors};
use super::stored::Stored;
use crate::error::Fault;

/// Targets that a file has at the most, and where nothing is said.
const MOST: usize = 255;
const USUAL: usize = 64;
/// Frames of which eigenvectors are computed.
pub(crate) const MOST_FRAMES: usize = 4096;

#[derive(Clone, Debug, Default)]
pub(crate) struct Wanted {
    /// At the most.
    pub(crate) targets: Option<usize>,
    /// What may be lost, as a share of the diagonal: as few targets are taken as hold it.
    pub(crate) max_error: Option<f64>,
    /// Whether that is what a guaranteed error leaves, and nobody asked for it.
    pub(crate) is_guarantee: bool,
    /// That of the rest pose; of the mean shape where it is not told.
    pub(crate) diagonal: Option<f64>,
}

impl Wanted {
    /// Targets at the most, however many frames there are.
    pub(crate) fn most(&self) -> usize {
        self.targets.unwrap_or(if self.max_error.is_some() { MOST } else { USUAL }).clamp(1, MOST)
    }
}

pub(super) struct Components {
    pub(super) stored: Stored,
    /// Frame after frame, from 0 to 1: programs hold the sliders of morph targets within that.
    pub(super) weights: Vec<f32>,
    pub(super) deviation: Deviation,
}

impl Components {
    /// Those of frames. What is stored lies beside its place by `rounding`, which is an error too.
    pub(super) fn of(
        frames: &Frames<'_>,
        floats: bool,
        wanted: &Wanted,
        rounding: impl Fn(&Stored) -> [f64; 3],
    ) -> Result<Self, Fault> {
        let most = wanted.most().min(frames.count - 1).min(frames.length);
        let mean = frames.mean();
        let directions = Directions::of(frames, &mean, most)?;
        let diagonal = wanted.diagonal.unwrap_or_else(|| diagonal(mean.as_chunks().0));
        let holds = |found: &Deviation| wanted.max_error.is_none_or(|error| found.largest <= error * diagonal);
        let mut targets = most;
        if wanted.max_error.is_some() {
            let mut errors = Errors::new(1.min(most), most, frames.count);
            for rows in frames.row_blocks() {
                let shapes = directions.shapes(frames, &mean, rows.clone(), most);
                errors.add(&frames.rows(rows, &mean), &shapes, directions.0.as_ref());
            }
            targets = errors.deviations(frames.length / 3, diagonal).find(holds).map_or(most, |found| found.targets);
        }
        loop {
            let stored = directions.stored(frames, &mean, targets, floats, diagonal, &rounding);
            let found = &stored.deviation;
            if holds(found) {
                return Ok(stored);
            }
            if targets == most {
                let share = found.share(found.largest);
                let found = format!("{} morph targets are {share:.2e} of the diagonal from the frames", found.targets);
                return Err(Fault::unsupported(if wanted.is_guarantee {
                    format!(
                        "cannot hold the guaranteed error of the capture: {found}; allow that with --targets \
                         {targets}, keep fewer frames (--range), or write .usdc or .abc"
                    )
                } else {
                    let error = wanted.max_error.unwrap_or_default();
                    format!(
                        "cannot hold --max-error {error}: {found}; allow more, keep fewer frames, take --float where \
                         that is near, or write .usdc or .abc"
                    )
                }));
            }
            // What is rounded takes more of them.
            targets = (targets + 1 + targets / 4).min(most);
        }
    }
}

/// Orthonormal weights: frames are about `shapes · weightsᵀ`, as near as so many columns come.
struct Directions(Mat<f64>);

impl Directions {
    fn of(frames: &Frames<'_>, base: &[f64], count: usize) -> Result<Self, Fault> {
        if count == 0 {
            return Ok(Self(Mat::zeros(frames.count, 0)));
        }
        let mut sum = Mat::zeros(frames.count, frames.count);
        frames.row_blocks().for_each(|rows| sum += gram(frames.rows(rows, base).as_ref(), BLOCK_ROWS));
        let found = eigen(mirrored(sum).as_ref());
        let (_, vectors) = found.ok_or_else(|| Fault::invalid("has no principal components; write .npy instead"))?;
        Ok(Self(vectors.subcols(0, count).to_owned()))
    }

    /// The first targets as stored, the base where their weights are smallest: none is negative.
    fn stored(
        &self,
        frames: &Frames<'_>,
        mean: &[f64],
        targets: usize,
        floats: bool,
        diagonal: f64,
        rounding: &impl Fn(&Stored) -> [f64; 3],
    ) -> Components {
        let mut weights = self.0.subcols(0, targets).to_owned();
        let smallest: Vec<f64> =
            weights.col_iter().map(|weights| weights.iter().copied().fold(f64::INFINITY, f64::min)).collect();
        let ranges: Vec<f64> = (0..targets)
            .map(|k| {
                let weights = weights.col_as_slice_mut(k);
                weights.iter_mut().for_each(|weight| *weight -= smallest[k]);
                weights.iter().copied().fold(0.0, f64::max)
            })
            .collect();
        let (mut base, mut largest) = (mean.to_vec(), vec![0.0_f64; targets]);
        for rows in frames.row_blocks() {
            let shapes = self.shapes(frames, mean, rows.clone(), targets);
            for (k, largest) in largest.iter_mut().enumerate() {
                let shape = shapes.col_as_slice(k);
                *largest = shape.iter().fold(*largest, |largest, x| largest.max(x.abs()));
                base[rows.clone()].iter_mut().zip(shape).for_each(|(base, x)| *base += smallest[k] * x);
            }
        }
        let reach = ranges.iter().zip(&largest).map(|(range, largest)| range * largest).fold(0.0, f64::max);
        let mut stored = Stored::base(&base, reach, targets, floats);
        let scales: Vec<f64> = (0..targets)
            .map(|k| {
                let [scale, inverse] = stored.scales(largest[k], ranges[k]);
                // As they are read.
                let read = |weight: f64| f64::from(((weight * inverse) as f32).min(1.0));
                weights.col_as_slice_mut(k).iter_mut().for_each(|weight| *weight = read(*weight));
                scale
            })
            .collect();
        let rounding = rounding(&stored);
        let mut decoded = stored.base_values();
        decoded.iter_mut().enumerate().for_each(|(k, x)| *x += rounding[k % 3]);
        let mut errors = Errors::new(targets, targets, frames.count);
        for rows in frames.row_blocks() {
            let mut shapes = self.shapes(frames, mean, rows.clone(), targets);
            for (k, scale) in scales.iter().enumerate() {
                let shape = shapes.col_as_slice_mut(k);
                shape.iter_mut().for_each(|x| *x *= scale);
                stored.put(k, rows.start, shape);
            }
            errors.add(&frames.rows(rows, &decoded), &shapes, weights.as_ref());
        }
        let deviation = errors.deviations(frames.length / 3, diagonal).next().unwrap_or_default();
        let all = weights.row_iter().flat_map(|frame| frame.iter().map(|&x| x as f32).collect::<Vec<_>>());
        Components { weights: all.collect(), stored, deviation }
    }

    /// Some rows of the first `count` shapes.
    fn shapes(&self, frames: &Frames<'_>, base: &[f64], rows: Range<usize>, count: usize) -> Mat<f64> {
        let mut out = Mat::zeros(rows.len(), count);
        multiply(out.as_mut(), frames.rows(rows, base).as_ref(), self.0.subcols(0, count));
        out
    }
}

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
