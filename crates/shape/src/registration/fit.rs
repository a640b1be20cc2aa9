//! A template's cage fitted to a surface without correspondence: matches both ways, point to plane, as rigid as possible.

use cager_geometry::linalg::{cholesky, solve_cholesky};
use cager_geometry::vector::Point;
use faer::{Mat, MatRef};
use glam::{DMat3, DVec3, Mat3A, Vec3A};
use rayon::prelude::*;

use super::anchors::Anchors;
use super::matching::{KnownMatches, OrientedPoints, match_weight};
use super::sparse_rows::single;
use super::target::Target;
use super::template::Template;
use crate::points::{matrix, outer, plain, row_points};

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

/// Holds what nothing else determines.
const START_WEIGHT: f64 = 1e-4;
/// A fit ends early once the samples move by less than this share of the diagonal.
const MIN_MOVE: f64 = 1e-4;
/// Matches that count less than this share of what they could are of a surface out of reach.
const MIN_WEIGHT: f64 = 1e-6;
/// Of the residual of conjugate gradients, squared.
const TOLERANCE: f64 = 1e-4;

/// Weighted squared distances along normals, by sample: `½ xᵢᵀ Bᵢ xᵢ − bᵢᵀ xᵢ` of a sample's displacement.
struct Distances {
    hessians: Vec<DMat3>,
    pulls: Vec<DVec3>,
    single_hessians: Vec<Mat3A>,
}

impl Distances {
    /// Sum of the traces of all Hessians: the weights of all matches, each a share of those one way, over the squared diagonal.
    fn trace(&self) -> f64 {
        self.hessians.iter().map(|b| b.x_axis.x + b.y_axis.y + b.z_axis.z).sum()
    }
}

/// What holds the cage beside the matches.
#[derive(Clone, Copy)]
struct Held<'a> {
    /// Weight of rigidity.
    rigidity: f64,
    /// Weight that holds the cage at its reference.
    hold: f64,
    anchors: Option<&'a Anchors>,
}

impl Template {
    /// The cage that lays the template onto a surface, from a cage near it. Runs on the current rayon pool; the result does not depend on it.
    pub fn fit(&self, target: &Target, start: &[Point], options: &FitOptions) -> Vec<Point> {
        self.fit_beside(target, start, start, options)
    }

    /// [`Self::fit`], whose matches are looked for near the last ones, unless these are of a surface of another number of points.
    pub fn fit_from(
        &self,
        target: &Target,
        start: &[Point],
        options: &FitOptions,
        known: &mut KnownMatches,
    ) -> Vec<Point> {
        self.fit_anchored(target, start, start, options, None, known).0
    }

    /// No matches with a surface, before the first.
    pub fn unmatched(&self, target: &Target) -> KnownMatches {
        KnownMatches::none(self.samples.len(), target.points.len())
    }

    /// [`Self::fit`], held at another cage than where it starts.
    pub fn fit_beside(
        &self,
        target: &Target,
        start: &[Point],
        reference: &[Point],
        options: &FitOptions,
    ) -> Vec<Point> {
        self.fit_anchored(target, start, reference, options, None, &mut self.unmatched(target)).0
    }

    /// [`Self::fit_beside`], with points that are pulled to their places; and whether the surface was in reach. Where it is not, nothing but anchors moves the
    /// cage.
    pub(crate) fn fit_anchored(
        &self,
        target: &Target,
        start: &[Point],
        reference: &[Point],
        options: &FitOptions,
        anchors: Option<&Anchors>,
        known: &mut KnownMatches,
    ) -> (Vec<Point>, bool) {
        let reference = matrix(reference);
        let mut cage = matrix(start);
        let m = cage.nrows();
        let hold = options.hold / (self.diagonal * self.diagonal * m as f64);
        let mut in_reach = true;
        for iteration in 0..options.iterations {
            let t = iteration as f64 / (options.iterations - 1).max(1) as f64;
            let between = |[first, last]: [f64; 2]| first * (last / first).powf(t);
            let (rigidity, reach) = (between(options.rigidity), between(options.reach) * self.diagonal);
            let distances = self.distances(target, cage.as_ref(), reach, (options.matched_back, iteration), known);
            let weight = distances.trace() * self.diagonal * self.diagonal;
            // Both ways together they could count two. NaN is out of reach as well.
            in_reach = anchors.is_some() || weight >= 2.0 * MIN_WEIGHT;
            if !in_reach {
                break;
            }
            let held = Held { rigidity, hold, anchors };
            let pulls = || {
                let mut pull = matrix(&self.coordinates.transposed_times(&distances.pulls));
                pull += faer::Scale(rigidity) * self.rigidity.pull(&self.rigidity.positions(cage.as_ref()));
                pull += faer::Scale(hold) * (&reference - &cage);
                match anchors {
                    Some(anchors) => pull + anchors.pull(cage.as_ref(), self.diagonal),
                    None => pull,
                }
            };
            let (pull, preconditioner) = rayon::join(pulls, || self.preconditioner(&distances, held));
            let Some(preconditioner) = preconditioner else { break };
            let change = self.solve(&distances, held, &preconditioner, pull, options.steps);
            let moved = self.sparse.times(&single(change.as_ref()));
            cage += &change;
            let mean = moved.iter().map(|x| f64::from(x.length_squared())).sum::<f64>() / moved.len() as f64;
            if mean.sqrt() < MIN_MOVE * self.diagonal && iteration > options.iterations / 2 {
                break;
            }
        }
        (plain(&row_points(cage.as_ref())), in_reach)
    }

    /// Matches of every sample with the surface, and of a part of the surface with the samples.
    fn distances(
        &self,
        target: &Target,
        cage: MatRef<'_, f64>,
        reach: f64,
        (most, turn): (usize, usize),
        known: &mut KnownMatches,
    ) -> Distances {
        known.keep_if_of(self.samples.len(), target.points.len());
        let (positions, normals) = self.samples_in(cage);
        let unit = 1.0 / (self.diagonal * self.diagonal);
        let share = unit / positions.len() as f64;
        let term = |normal: DVec3, weight: f64, offset: DVec3| {
            let weighted = weight * normal;
            let hessian = outer(weighted, normal);
            (hessian, -offset.dot(normal) * weighted)
        };
        let (mut hessians, mut pulls): (Vec<DMat3>, Vec<DVec3>) = positions
            .par_iter()
            .zip(&normals)
            .zip(&mut known.there)
            .with_min_len(64)
            .map(|((&p, &n), known)| {
                let (j, _) = target.tree.nearest_again(p, n, known);
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
                let (point, normal, mut match_of) = (target.points[k], target.normals[k], known.back[k]);
                let (i, _) = samples.nearest_again(point, normal, &mut match_of);
                let offset = positions[i] - point;
                (i, term(normal, share * match_weight(normals[i].dot(normal), offset, reach), offset))
            })
            .collect();
        back.iter().zip(&terms).for_each(|(&k, (i, _))| known.back[k] = Some(*i as u32));
        for (i, (hessian, pull)) in terms {
            hessians[i] += hessian;
            pulls[i] += pull;
        }
        let single_hessians = hessians.iter().map(|b| Mat3A::from(b.as_mat3())).collect();
        Distances { hessians, pulls, single_hessians }
    }

    /// The Cholesky factor of a Hessian in which every sample's is the mean of all in every direction.
    fn preconditioner(&self, distances: &Distances, held: Held<'_>) -> Option<Mat<f64>> {
        let scale = distances.trace() * self.diagonal * self.diagonal / 3.0;
        let mut sum = faer::Scale(scale) * &self.gram + faer::Scale(held.rigidity) * self.rigidity.hessian();
        if let Some(anchors) = held.anchors {
            sum += anchors.hessian(self.diagonal);
        }
        let ridge = RIDGE / (self.diagonal * self.diagonal);
        (0..sum.nrows()).for_each(|k| sum[(k, k)] += held.hold + ridge);
        cholesky(sum)
    }

    /// The Hessian times a change of the cage, of coordinates without their small entries, in single precision.
    fn hessian_times(&self, distances: &Distances, held: Held<'_>, x: MatRef<'_, f64>) -> Mat<f64> {
        let Held { rigidity, hold, anchors } = held;
        let change = single(x);
        let moved = self.sparse.times(&change);
        let pulled: Vec<Vec3A> = moved.iter().zip(&distances.single_hessians).map(|(&x, &b)| b * x).collect();
        let sum = self.sparse.transposed_times(&pulled);
        let rigid = self.rigidity.hessian_times(&change);
        let product = Mat::from_fn(x.nrows(), 3, |i, k| {
            f64::from(sum[i][k]) + rigidity * f64::from(rigid[i][k]) + hold * x[(i, k)]
        });
        match anchors {
            Some(anchors) => product + anchors.hessian_times(x, self.diagonal),
            None => product,
        }
    }

    /// Conjugate gradients from 0.
    fn solve(
        &self,
        distances: &Distances,
        held: Held<'_>,
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
            let image = self.hessian_times(distances, held, direction.as_ref());
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
}

/// Keeps the preconditioner definite; over the squared diagonal, as all it is added to.
const RIDGE: f64 = 1e-9;

/// Sum of the products of entries.
fn inner(a: &Mat<f64>, b: &Mat<f64>) -> f64 {
    (0..a.ncols()).map(|j| (0..a.nrows()).map(|i| a[(i, j)] * b[(i, j)]).sum::<f64>()).sum()
}
