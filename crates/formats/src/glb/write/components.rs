//! Principal components of frames, by eigenvectors of the smaller of their two Gram matrices (the method of snapshots: Sirovich, "Turbulence and the
//! dynamics of coherent structures", 1987).

use std::ops::Range;

use cager_geometry::linalg::{BLOCK_ROWS, eigen, gram, mirrored, multiply};
use cager_geometry::mesh::diagonal;
use faer::Mat;
use rayon::prelude::*;

use super::frames::Frames;
use super::stored::Stored;
use crate::error::Fault;

/// Targets that a file has at the most, and where nothing is said.
const MOST: usize = 255;
const USUAL: usize = 64;
/// Frames or coordinates, whichever are fewer, of which eigenvectors are computed.
pub(crate) const LARGEST_SIDE: usize = 4096;

/// How many targets are wanted.
#[derive(Clone, Debug, Default)]
pub(crate) struct Wanted {
    /// At the most.
    pub(crate) targets: Option<usize>,
    /// What may be lost, as a share of the diagonal: as few targets are taken as hold it.
    pub(crate) max_error: Option<f64>,
    /// That of the rest pose; of the mean shape where it is not told.
    pub(crate) diagonal: Option<f64>,
}

impl Wanted {
    /// Targets at the most, however many frames there are.
    pub(crate) fn most(&self) -> usize {
        self.targets.unwrap_or(if self.max_error.is_some() { MOST } else { USUAL }).clamp(1, MOST)
    }
}

/// How far what is written is from the frames.
#[derive(Clone, Debug, Default)]
pub(crate) struct Deviation {
    pub(crate) targets: usize,
    /// The largest distance of a point.
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

/// Targets, and their weights in each frame.
pub(super) struct Components {
    /// Frame after frame.
    pub(super) weights: Vec<f32>,
    pub(super) deviation: Deviation,
}

impl Components {
    /// Stores as many targets as are wanted; behind those that [`Deviation::targets`] counts there may be others.
    /// All of it lies beside its place by `rounding`, which counts as an error.
    pub(super) fn of(
        frames: &Frames<'_>,
        stored: &mut Stored,
        wanted: &Wanted,
        rounding: [f64; 3],
    ) -> Result<Self, Fault> {
        let most = wanted.most().min(frames.count - 1).min(frames.length);
        let base = stored.base_values();
        let directions = Directions::of(frames, &base, most)?;
        stored.reserve(most);
        let mut largest = vec![0.0_f64; most];
        for rows in frames.row_blocks() {
            let block = directions.shapes(frames, &base, rows);
            largest.iter_mut().enumerate().for_each(|(k, largest)| *largest = largest.max(block.col(k).norm_max()));
        }
        let mut weights = directions.weights.clone();
        let mut scales = Vec::with_capacity(most);
        for (k, &largest) in largest.iter().enumerate() {
            let [scale, inverse] = stored.scales(largest, weights.col(k).norm_max());
            // As they are read.
            weights.col_mut(k).iter_mut().for_each(|weight| *weight = f64::from((*weight * inverse) as f32));
            scales.push(scale);
        }
        let mut decoded = base.clone();
        decoded.iter_mut().enumerate().for_each(|(k, x)| *x += rounding[k % 3]);
        let first_level = if wanted.max_error.is_some() { 1.min(most) } else { most };
        let mut errors = Errors { first_level, frames: vec![vec![[0.0; 2]; most + 1 - first_level]; frames.count] };
        for rows in frames.row_blocks() {
            let mut shapes = directions.shapes(frames, &base, rows.clone());
            for (k, scale) in scales.iter().enumerate() {
                let shape = shapes.col_as_slice_mut(k);
                shape.iter_mut().for_each(|x| *x *= scale);
                stored.put(k, rows.start, shape);
            }
            errors.add(&frames.rows(rows, &decoded), &shapes, &weights);
        }
        let diagonal = wanted.diagonal.unwrap_or_else(|| diagonal(base.as_chunks().0));
        let deviation = errors.choose(frames.length / 3, wanted.max_error, diagonal)?;
        let weights = (0..frames.count)
            .flat_map(|frame| (0..deviation.targets).map(move |k| (frame, k)))
            .map(|at| weights[at] as f32)
            .collect();
        Ok(Self { weights, deviation })
    }
}

/// Frames are about `shapes · weightsᵀ`, as near as so many columns come.
struct Directions {
    weights: Mat<f64>,
    /// Shapes that are orthonormal; otherwise weights are, and tell the shapes.
    shapes: Option<Mat<f64>>,
}

impl Directions {
    fn of(frames: &Frames<'_>, base: &[f64], count: usize) -> Result<Self, Fault> {
        if count == 0 {
            return Ok(Self { weights: Mat::zeros(frames.count, 0), shapes: None });
        }
        let side = frames.count.min(frames.length);
        let mut sum = Mat::zeros(side, side);
        if frames.count <= frames.length {
            frames.row_blocks().for_each(|rows| sum += gram(frames.rows(rows, base).as_ref(), BLOCK_ROWS));
            return Ok(Self { weights: leading(sum, count)?, shapes: None });
        }
        frames.frame_blocks().for_each(|block| sum += gram(frames.columns(block, base).as_ref(), BLOCK_ROWS));
        let shapes = leading(sum, count)?;
        let mut weights = Mat::zeros(frames.count, count);
        for block in frames.frame_blocks() {
            let differences = frames.columns(block.clone(), base);
            multiply(weights.as_mut().subrows_mut(block.start, block.len()), differences.as_ref(), shapes.as_ref());
        }
        Ok(Self { weights, shapes: Some(shapes) })
    }

    /// Some rows of the shapes.
    fn shapes(&self, frames: &Frames<'_>, base: &[f64], rows: Range<usize>) -> Mat<f64> {
        if let Some(shapes) = &self.shapes {
            return shapes.subrows(rows.start, rows.len()).to_owned();
        }
        let mut out = Mat::zeros(rows.len(), self.weights.ncols());
        multiply(out.as_mut(), frames.rows(rows, base).as_ref(), self.weights.as_ref());
        out
    }
}

/// The first eigenvectors of a matrix by its lower triangle.
fn leading(lower: Mat<f64>, count: usize) -> Result<Mat<f64>, Fault> {
    let found = eigen(mirrored(lower).as_ref());
    let (_, vectors) = found.ok_or_else(|| Fault::invalid("has no principal components; write .npy instead"))?;
    Ok(vectors.subcols(0, count).to_owned())
}

/// How far frames are from what the first targets make of them, for several numbers of targets.
struct Errors {
    /// The smallest of these.
    first_level: usize,
    /// By frame and number of targets: the largest squared distance of a point, and the sum of all.
    frames: Vec<Vec<[f64; 2]>>,
}

impl Errors {
    /// Adds some points of all frames: what they differ from the base, what targets move them by, and the weights of these.
    fn add(&mut self, differences: &Mat<f64>, shapes: &Mat<f64>, weights: &Mat<f64>) {
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

    /// The fewest targets that hold the error, a share of the diagonal, or all where none is said.
    fn choose(&self, points: usize, max_error: Option<f64>, diagonal: f64) -> Result<Deviation, Fault> {
        let of = |level: usize| {
            let frames = self.frames.iter().map(|levels| levels[level]);
            let [largest, sum] = frames.fold([0.0_f64, 0.0], |[most, sum], [x, y]| [most.max(x), sum + y]);
            let rms = (sum / (points * self.frames.len()) as f64).sqrt();
            Deviation { targets: self.first_level + level, largest: largest.sqrt(), rms, diagonal }
        };
        let levels = self.frames.first().map_or(0, Vec::len);
        let holds = |found: &Deviation| max_error.is_none_or(|error| found.largest <= error * diagonal);
        (0..levels).map(of).find(holds).ok_or_else(|| {
            let found = of(levels - 1);
            Fault::unsupported(format!(
                "cannot hold --max-error {}: {} morph targets are {:.2e} of the diagonal from the frames; allow more, keep fewer frames, take --float where that is near, or write .usdc or .abc",
                max_error.unwrap_or_default(),
                found.targets,
                found.share(found.largest)
            ))
        })
    }
}
