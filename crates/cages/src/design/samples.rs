//! Points with the non-affine part of their motion, and those that cages are chosen and judged by.

use super::fit::{BLOCK_ROWS, Fit, ridge_factor};
use super::parts::Parts;
use cager_core::cage::Cage;
use cager_core::coordinates::MeanValue;
use cager_geometry::linalg::{accumulate_product, gram, solve_cholesky, to_double, to_single, transposed_product};
use cager_geometry::mesh::{Model, Point, diagonal};
use faer::{Accum, Mat, MatRef, concat};
use std::ops::Range;

/// Maximum number of points sampled from a model.
const MAX_POINTS: usize = 20_000;
/// Number of principal components that the motion is reduced to, at most.
const COLUMNS: usize = 96;
/// Root mean square of the motion that the reduction may leave out, as a fraction of the diagonal.
const LEFT_OUT: f64 = 1e-5;
/// Numbers of points and frames on which a cage is evaluated.
const JUDGED_POINTS: usize = 8_000;
const JUDGED_FRAMES: usize = 40;
/// Ridge of the fits that judge a cage, as a fraction of the mean diagonal entry of `ΦᵀΦ`.
pub(super) const RIDGE: f64 = 1e-6;
/// Number of vertices above which the condition number is not computed.
const LARGE: usize = 1_000;

/// Points and their motion.
pub(crate) struct Samples {
    /// Rest positions, n.
    points: Vec<Point>,
    /// Training motion, n × c, over the diagonal: each frame less its best affine image of the rest
    /// pose, which coordinates reproduce exactly, on the principal components of all frames. A fit
    /// to these has the same sum of squared residuals as one to the frames, up to the truncation.
    training: Mat<f32>,
    /// Points that cages are judged at, the principal components of their motion, in training
    /// frames and, from column `chosen_from` on, in the choosing ones; and the numbers of both.
    pub(super) judged_points: Vec<Point>,
    pub(super) judged_motion: Mat<f32>,
    pub(super) chosen_from: usize,
    pub(super) judged_frames: [usize; 2],
    /// Their motion in frames that neither sees, and how many these are.
    unseen: Option<(Mat<f32>, usize)>,
    /// Diagonal of the rest pose.
    pub(crate) diagonal: f64,
}

/// Points of one step.
pub(super) struct Batch {
    pub(super) points: Vec<Point>,
    /// n × c.
    pub(super) motion: Mat<f32>,
}

/// Least-squares errors of a cage, over the diagonal; infinite where it has none.
#[derive(Clone, Debug)]
pub(crate) struct Evaluation {
    pub(super) training_error: f64,
    pub(crate) validation_error: f64,
    /// `ΦᵀΦ` of the points; `None` for large cages, whose condition number would take too long.
    gram: Option<Mat<f64>>,
}

impl Evaluation {
    /// Of no cage, worse than any other.
    pub(super) fn worst() -> Self {
        Self { training_error: f64::INFINITY, validation_error: f64::INFINITY, gram: None }
    }

    /// Condition number of the coordinates, infinite where singular; `None` for large cages.
    pub(super) fn condition_number(&self) -> Option<f64> {
        let squares = self.gram.as_ref()?.self_adjoint_eigenvalues(faer::Side::Lower).ok()?;
        let (first, last) = (squares.first()?, squares.last()?);
        Some(if *first > 0.0 { (last / first).sqrt() } else { f64::INFINITY })
    }
}

impl Samples {
    /// Of frames with these parts.
    pub(crate) fn new(rest: &Model, frames: &[Vec<f64>], parts: &Parts, random: &mut fastrand::Rng) -> Self {
        let of = |part: &[usize]| -> Vec<&[f64]> { part.iter().map(|&frame| frames[frame].as_slice()).collect() };
        let (designed, choosing) = (of(&parts.designed), of(&parts.choosing));
        let unseen = of(&parts.unseen.iter().cloned().flatten().collect::<Vec<_>>());
        let mut some = |count: usize| -> Vec<usize> {
            let mut indices = random.choose_multiple(0..rest.points.len(), count);
            indices.sort_unstable();
            indices
        };
        let (used, judged_points) = (some(MAX_POINTS), some(JUDGED_POINTS));
        let (seen, choosing) = (evenly(&designed, JUDGED_FRAMES), evenly(&choosing, JUDGED_FRAMES));
        let unseen = evenly(&unseen, JUDGED_FRAMES);
        let motion = |frames: &[&[f64]]| principal(&without_affine(&rest.points, &judged_points, frames), usize::MAX);
        let (seen_motion, chosen_motion) = (motion(&seen), motion(&choosing));
        let single = |motion: &Mat<f64>| to_single(motion.as_ref(), judged_points.len());
        let at = |indices: &[usize]| -> Vec<Point> { indices.iter().map(|&i| rest.points[i]).collect() };
        Self {
            points: at(&used),
            training: to_single(
                principal(&without_affine(&rest.points, &used, &designed), COLUMNS).as_ref(),
                used.len(),
            ),
            judged_points: at(&judged_points),
            judged_motion: single(&concat![[seen_motion, chosen_motion]]),
            chosen_from: seen_motion.ncols(),
            judged_frames: [seen.len(), choosing.len()],
            unseen: (!unseen.is_empty()).then(|| (single(&motion(&unseen)), unseen.len())),
            diagonal: diagonal(&rest.points),
        }
    }

    /// Root mean square of what the judged points move in the frames that are designed from, beyond
    /// affine images of the rest pose and over the diagonal.
    pub(crate) fn motion(&self) -> f64 {
        root_mean_square(self.judged_motion.as_ref(), 0..self.chosen_from, self.judged_frames[0])
    }

    /// Random points and their motion.
    pub(super) fn batch(&self, points: usize, random: &mut fastrand::Rng) -> Batch {
        let mut rows = random.choose_multiple(0..self.points.len(), points);
        rows.sort_unstable();
        let motion = Mat::from_fn(rows.len(), self.training.ncols(), |i, c| self.training[(rows[i], c)]);
        Batch { points: rows.iter().map(|&i| self.points[i]).collect(), motion }
    }

    /// Root mean square errors of a cage.
    pub(crate) fn evaluate(&self, cage: &Cage) -> Evaluation {
        let (gram, residual) = self.residual(cage, &self.judged_motion);
        let kept = (gram.nrows() <= LARGE).then_some(gram);
        let error = |columns: Range<usize>, frames: usize| {
            residual.as_ref().map_or(f64::INFINITY, |left| root_mean_square(left.as_ref(), columns, frames))
        };
        let [seen, choosing] = self.judged_frames;
        Evaluation {
            training_error: error(0..self.chosen_from, seen),
            validation_error: error(self.chosen_from..self.judged_motion.ncols(), choosing),
            gram: kept,
        }
    }

    /// The error of a cage on unseen frames, infinite where it has none; `None` without such
    /// frames.
    pub(super) fn unseen_error(&self, cage: &Cage) -> Option<f64> {
        let (motion, frames) = self.unseen.as_ref()?;
        let (_, residual) = self.residual(cage, motion);
        Some(residual.map_or(f64::INFINITY, |left| root_mean_square(left.as_ref(), 0..left.ncols(), *frames)))
    }

    /// `ΦᵀΦ` of the points that cages are judged at, and what a fit to their motion leaves.
    fn residual(&self, cage: &Cage, motion: &Mat<f32>) -> (Mat<f64>, Option<Mat<f32>>) {
        let phi = MeanValue.smooth_coordinates(cage, &self.judged_points);
        // In single precision `ΦᵀΦ` would be off by more than the ridge.
        let gram = gram(to_double(phi.as_ref()).as_ref(), BLOCK_ROWS);
        let fit = Fit::of_factor(phi.as_ref(), motion.as_ref(), || ridge_factor(gram.clone(), RIDGE));
        (gram, fit.map(|fit| fit.residual))
    }
}

/// Of some columns, which stand for so many frames.
fn root_mean_square(residual: MatRef<'_, f32>, columns: Range<usize>, frames: usize) -> f64 {
    let left = residual.subcols(columns.start, columns.len());
    (f64::from(left.squared_norm_l2()) / (left.nrows() * frames) as f64).sqrt()
}

/// At most `count` of the frames, evenly spaced.
pub(super) fn evenly<'a>(frames: &[&'a [f64]], count: usize) -> Vec<&'a [f64]> {
    let count = count.min(frames.len());
    (0..count).map(|k| frames[k * frames.len() / count]).collect()
}

/// A motion in the fewest principal directions that leave out no more than [`LEFT_OUT`].
pub(super) fn principal(motion: &Mat<f64>, most: usize) -> Mat<f64> {
    let columns = motion.ncols();
    let Ok(eigen) = gram(motion.as_ref(), BLOCK_ROWS).self_adjoint_eigen(faer::Side::Lower) else {
        return motion.clone();
    };
    // Sum of squares that may be left out; points have three columns a frame. Eigenvalues ascend.
    let may_leave = LEFT_OUT * LEFT_OUT * (motion.nrows() * columns) as f64 / 3.0;
    let mut left_out = 0.0;
    let needed = eigen.S().column_vector().iter().position(|square| {
        left_out += square.max(0.0);
        left_out > may_leave
    });
    let first = needed.unwrap_or(columns - 1).max(columns.saturating_sub(most));
    let mut out = Mat::zeros(motion.nrows(), columns - first);
    accumulate_product(&mut out, Accum::Replace, motion.as_ref(), eigen.U().subcols(first, columns - first), 1.0);
    out
}

/// The motion of some points over the diagonal, less the best affine image of the rest pose.
fn without_affine(rest: &[Point], rows: &[usize], frames: &[&[f64]]) -> Mat<f64> {
    let scale = diagonal(rest);
    let motion = Mat::from_fn(rows.len(), 3 * frames.len(), |i, c| frames[c / 3][3 * rows[i] + c % 3] / scale);
    let center: Point = std::array::from_fn(|k| rest.iter().map(|p| p[k]).sum::<f64>() / rest.len() as f64);
    let basis = Mat::from_fn(rows.len(), 4, |i, k| if k < 3 { (rest[rows[i]][k] - center[k]) / scale } else { 1.0 });
    least_squares_residual(basis.as_ref(), &motion, 1e-12).unwrap_or(motion)
}

/// `X − A C` with the C that minimises `‖X − A C‖² + ρ ‖C‖²`, `ρ` as in [`ridge_factor`].
fn least_squares_residual(a: MatRef<'_, f64>, motion: &Mat<f64>, ridge: f64) -> Option<Mat<f64>> {
    let factor = ridge_factor(gram(a, BLOCK_ROWS), ridge)?;
    let mut solution = transposed_product(a, motion.as_ref(), BLOCK_ROWS);
    solve_cholesky(factor.as_ref(), &mut solution);
    let mut residual = motion.clone();
    accumulate_product(&mut residual, Accum::Add, a, solution.as_ref(), -1.0);
    residual.as_ref().squared_norm_l2().is_finite().then_some(residual)
}
