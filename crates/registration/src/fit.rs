//! A template's cage fitted to a surface without correspondence: matches both ways, point to plane, as rigid as possible.

use cager_geometry::linalg::{cholesky, solve_cholesky, tall_product, transposed_product};
use cager_geometry::vector::Point;
use faer::{Mat, MatRef};
use glam::{DMat3, DVec3, Mat3A, Vec3A};
use rayon::prelude::*;

use crate::matching::{OrientedPoints, match_weight};
use crate::observation::Observation;
use crate::sparse_rows::{matrix, points, single, vectors};
use crate::template::{Template, plain, pose};

/// How a fit goes from stiff and far-seeing to loose and exact: `[first, last]` of each iteration's values, in between in proportion.
#[derive(Clone, Copy, Debug)]
pub struct FitOptions {
    /// Iterations, each with matches of its own, at the most.
    pub iterations: usize,
    /// Weight of rigidity.
    pub rigidity: [f64; 2],
    /// Distance at which a match counts a quarter, as a share of the diagonal.
    pub reach: [f64; 2],
    /// Observed points that are matched back to the template in each iteration, at the most.
    pub matched_back: usize,
    /// Steps of conjugate gradients in each iteration, at the most.
    pub steps: usize,
    /// Weight that holds the cage at its reference, of a mean squared distance as a share of the diagonal.
    pub hold: f64,
}

impl FitOptions {
    /// For a start that is near: the frame before.
    pub const NEAR: Self = Self {
        iterations: 8,
        rigidity: [1e-3, 1e-5],
        reach: [0.03, 0.006],
        matched_back: 5000,
        steps: 12,
        hold: START_WEIGHT,
    };
    /// For a start that may be far.
    pub const FAR: Self = Self { iterations: 16, rigidity: [1e-2, 1e-5], reach: [0.1, 0.006], ..Self::NEAR };
}

/// A surface made ready to be matched.
pub struct Target {
    points: Vec<DVec3>,
    normals: Vec<DVec3>,
    tree: OrientedPoints,
    normal_length: f64,
}

/// What a normal counts in matches, as a share of the diagonal.
const NORMAL_LENGTH: f64 = 0.02;
/// Holds what nothing else determines.
const START_WEIGHT: f64 = 1e-4;
/// A fit ends early once the samples move by less than this share of the diagonal.
const MIN_MOVE: f64 = 1e-4;
/// Of the residual of conjugate gradients, squared.
const TOLERANCE: f64 = 1e-4;
/// Distances count no more than this in a score, as a share of the diagonal.
const MAX_SCORED: f64 = 0.05;
/// Of the observed points, every so manieth is scored.
const SCORED_EVERY: usize = 5;
const BLOCK_ROWS: usize = 512;

impl Target {
    /// An observation for a template of this diagonal.
    ///
    /// # Panics
    /// Where it has no points.
    pub fn new(observation: &Observation, diagonal: f64) -> Self {
        let normal_length = NORMAL_LENGTH * diagonal;
        Self {
            points: vectors(&observation.points),
            normals: vectors(&observation.normals),
            tree: OrientedPoints::new(&observation.points, &observation.normals, normal_length),
            normal_length,
        }
    }

    /// The observation.
    pub fn observation(&self) -> Observation {
        Observation { points: plain(&self.points), normals: plain(&self.normals) }
    }

    /// The observed points.
    pub fn points(&self) -> &[DVec3] {
        &self.points
    }

    /// Their unit normals.
    pub fn normals(&self) -> &[DVec3] {
        &self.normals
    }

    /// The observed point that a point with this unit normal matches.
    pub fn nearest(&self, point: DVec3, normal: DVec3) -> usize {
        self.tree.nearest(point.to_array(), normal.to_array()).0
    }

    /// What a normal counts in matches, in the unit of the points.
    pub fn normal_length(&self) -> f64 {
        self.normal_length
    }
}

/// Weighted squared distances along normals, by sample: `½ xᵢᵀ Bᵢ xᵢ − bᵢᵀ xᵢ` of a sample's displacement.
struct Distances {
    hessians: Vec<DMat3>,
    pulls: Vec<DVec3>,
    single_hessians: Vec<Mat3A>,
}

impl Template {
    /// Samples in a cage: positions and unit normals.
    fn samples_in(&self, cage: MatRef<'_, f64>) -> (Vec<DVec3>, Vec<DVec3>) {
        let corners = points(tall_product(self.corner_coordinates.as_ref(), cage).as_ref());
        self.samples.iter().map(|sample| pose(sample, &corners)).unzip()
    }

    /// The cage that lays the template onto a surface, from a cage near it. Runs on the current rayon pool; the result does not depend on it.
    pub fn fit(&self, target: &Target, start: &[Point], options: &FitOptions) -> Vec<Point> {
        self.fit_beside(target, start, start, options)
    }

    /// [`Self::fit`], held at another cage than where it starts.
    pub fn fit_beside(
        &self,
        target: &Target,
        start: &[Point],
        reference: &[Point],
        options: &FitOptions,
    ) -> Vec<Point> {
        let reference = matrix(&vectors(reference));
        let mut cage = matrix(&vectors(start));
        let m = cage.nrows();
        let hold = options.hold / (self.diagonal * self.diagonal * m as f64);
        for iteration in 0..options.iterations {
            let t = iteration as f64 / (options.iterations - 1).max(1) as f64;
            let between = |[first, last]: [f64; 2]| first * (last / first).powf(t);
            let (rigidity, reach) = (between(options.rigidity), between(options.reach) * self.diagonal);
            let distances = self.distances(target, cage.as_ref(), reach, options.matched_back, iteration);
            let mut pull = transposed_product(self.coordinates.as_ref(), matrix(&distances.pulls).as_ref(), BLOCK_ROWS);
            pull += faer::Scale(rigidity) * self.rigidity.pull(&self.rigidity.positions(cage.as_ref()));
            pull += faer::Scale(hold) * (&reference - &cage);
            let Some(preconditioner) = self.preconditioner(&distances, rigidity, hold) else { break };
            let change = self.solve(&distances, rigidity, hold, &preconditioner, pull, options.steps);
            let moved = self.sparse.times(&single(change.as_ref()));
            cage += &change;
            let mean = moved.iter().map(|x| f64::from(x.length_squared())).sum::<f64>() / moved.len() as f64;
            if mean.sqrt() < MIN_MOVE * self.diagonal && iteration > options.iterations / 2 {
                break;
            }
        }
        plain(&points(cage.as_ref()))
    }

    /// Matches of every sample with the surface, and of a part of the surface with the samples.
    fn distances(&self, target: &Target, cage: MatRef<'_, f64>, reach: f64, most: usize, turn: usize) -> Distances {
        let (positions, normals) = self.samples_in(cage);
        let unit = 1.0 / (self.diagonal * self.diagonal);
        let share = unit / positions.len() as f64;
        let term = |normal: DVec3, weight: f64, offset: DVec3| {
            let weighted = weight * normal;
            let hessian = DMat3::from_cols(weighted * normal.x, weighted * normal.y, weighted * normal.z);
            (hessian, -offset.dot(normal) * weighted)
        };
        let (mut hessians, mut pulls): (Vec<DMat3>, Vec<DVec3>) = positions
            .par_iter()
            .zip(&normals)
            .with_min_len(64)
            .map(|(&p, &n)| {
                let (j, _) = target.tree.nearest(p.to_array(), n.to_array());
                let (offset, normal) = (p - target.points[j], target.normals[j]);
                term(normal, share * match_weight(n.dot(normal), offset, reach), offset)
            })
            .unzip();
        let every = (target.points.len() / most.min(target.points.len()).max(1)).max(1);
        let back: Vec<usize> = (turn % every..target.points.len()).step_by(every).collect();
        let samples = OrientedPoints::new(&plain(&positions), &plain(&normals), target.normal_length);
        let share = unit / back.len() as f64;
        let terms: Vec<(usize, (DMat3, DVec3))> = back
            .par_iter()
            .with_min_len(64)
            .map(|&k| {
                let (point, normal) = (target.points[k], target.normals[k]);
                let (i, _) = samples.nearest(point.to_array(), normal.to_array());
                let offset = positions[i] - point;
                (i, term(normal, share * match_weight(normals[i].dot(normal), offset, reach), offset))
            })
            .collect();
        for (i, (hessian, pull)) in terms {
            hessians[i] += hessian;
            pulls[i] += pull;
        }
        let single_hessians = hessians.iter().map(|b| Mat3A::from(b.as_mat3())).collect();
        Distances { hessians, pulls, single_hessians }
    }

    /// The Cholesky factor of a Hessian in which every sample's is the mean of all in every direction.
    fn preconditioner(&self, distances: &Distances, rigidity: f64, hold: f64) -> Option<Mat<f64>> {
        let traces: f64 = distances.hessians.iter().map(|b| b.x_axis.x + b.y_axis.y + b.z_axis.z).sum();
        let scale = traces * self.diagonal * self.diagonal / 3.0;
        let mut sum = faer::Scale(scale) * &self.gram + faer::Scale(rigidity) * &self.rigidity_hessian;
        (0..sum.nrows()).for_each(|k| sum[(k, k)] += hold + RIDGE);
        cholesky(sum)
    }

    /// The Hessian times a change of the cage, of coordinates without their small entries, in single precision.
    fn hessian_times(&self, distances: &Distances, rigidity: f64, hold: f64, x: MatRef<'_, f64>) -> Mat<f64> {
        let change = single(x);
        let moved = self.sparse.times(&change);
        let pulled: Vec<Vec3A> = moved.iter().zip(&distances.single_hessians).map(|(&x, &b)| b * x).collect();
        let sum = self.sparse.transposed_times(&pulled);
        let rigid = self.rigidity.hessian_times(&change);
        Mat::from_fn(x.nrows(), 3, |i, k| f64::from(sum[i][k]) + rigidity * f64::from(rigid[i][k]) + hold * x[(i, k)])
    }

    /// Conjugate gradients from 0.
    fn solve(
        &self,
        distances: &Distances,
        rigidity: f64,
        hold: f64,
        preconditioner: &Mat<f64>,
        mut residual: Mat<f64>,
        steps: usize,
    ) -> Mat<f64> {
        let mut x = Mat::zeros(residual.nrows(), 3);
        let preconditioned = |r: &Mat<f64>| {
            let mut z = r.clone();
            solve_cholesky(preconditioner.as_ref(), &mut z);
            z
        };
        let mut z = preconditioned(&residual);
        let mut direction = z.clone();
        let first = inner(&residual, &z);
        let mut size = first;
        for _ in 0..steps {
            let image = self.hessian_times(distances, rigidity, hold, direction.as_ref());
            let curvature = inner(&direction, &image);
            if curvature.is_nan() || curvature <= 0.0 {
                break;
            }
            let step = size / curvature;
            x += faer::Scale(step) * &direction;
            residual -= faer::Scale(step) * &image;
            z = preconditioned(&residual);
            let next = inner(&residual, &z);
            if next < TOLERANCE * first {
                break;
            }
            direction = &z + faer::Scale(next / size) * &direction;
            size = next;
        }
        x
    }

    /// How well the template lies on a surface in a cage: the root mean square, both ways, of the distance from the plane of the nearest point and of the difference of
    /// normals together, as a share of the diagonal; distances beyond 5 % count as 5 %.
    pub fn score(&self, target: &Target, cage: &[Point]) -> f64 {
        let (positions, normals) = self.samples_in(matrix(&vectors(cage)).as_ref());
        let samples = OrientedPoints::new(&plain(&positions), &plain(&normals), target.normal_length);
        let scored = |offset: DVec3, own: DVec3, other: DVec3, d2: f64| {
            let far = d2.sqrt() / self.diagonal;
            let plane = offset.dot(other) / self.diagonal;
            let turn = NORMAL_LENGTH * (own - other).length();
            if far > MAX_SCORED { MAX_SCORED } else { (plane * plane + turn * turn).sqrt().min(MAX_SCORED) }
        };
        let there: Vec<f64> = positions
            .par_iter()
            .zip(&normals)
            .with_min_len(64)
            .map(|(&p, &n)| {
                let (j, d2) = target.tree.nearest(p.to_array(), n.to_array());
                scored(p - target.points[j], n, target.normals[j], d2)
            })
            .collect();
        let back: Vec<f64> = (0..target.points.len())
            .into_par_iter()
            .step_by(SCORED_EVERY)
            .with_min_len(64)
            .map(|k| {
                let (point, normal) = (target.points[k], target.normals[k]);
                let (i, d2) = samples.nearest(point.to_array(), normal.to_array());
                scored(point - positions[i], normal, normals[i], d2)
            })
            .collect();
        let mean = |distances: &[f64]| (distances.iter().map(|d| d * d).sum::<f64>() / distances.len() as f64).sqrt();
        mean(&there) + mean(&back)
    }
}

/// Keeps the preconditioner definite.
const RIDGE: f64 = 1e-9;

/// Sum of the products of entries.
fn inner(a: &Mat<f64>, b: &Mat<f64>) -> f64 {
    (0..a.ncols()).map(|j| (0..a.nrows()).map(|i| a[(i, j)] * b[(i, j)]).sum::<f64>()).sum()
}
