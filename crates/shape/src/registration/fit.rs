//! A cage fitted to a surface without correspondence: matches both ways, point to plane, as rigid
//! as possible.

use cager_geometry::linalg::{cholesky, solve_cholesky};
use cager_geometry::vector::Point;
use faer::Mat;
use glam::{DVec3, Mat3A, Vec3A};

use super::anchors::Anchors;
use super::conjugate_gradients::conjugate_gradients;
use super::matching::KnownMatches;
use super::planes::{MatchWeights, PlaneDistances};
use super::target::Target;
use super::template::Template;
use crate::points::{matrix, plain, row_points, trace, vectors};

/// How a fit goes from stiff and far-seeing to loose and exact: `[first, last]` of each value.
#[derive(Clone, Copy, Debug)]
pub struct FitOptions {
    /// Iterations, each with matches of its own, at the most.
    pub iterations: usize,
    /// Weight of rigidity.
    pub rigidity: [f64; 2],
    /// Distance at which a match counts a quarter, as a share of the diagonal.
    pub reach: [f64; 2],
    /// Weight of the cage's mean squared distance from its reference, over the diagonal.
    pub hold: f64,
}

impl FitOptions {
    /// For a start that is near: the frame before.
    pub const NEAR: Self = Self { iterations: 8, rigidity: [1e-3, 1e-5], reach: [0.03, 0.006], hold: START_WEIGHT };
    /// For a start that may be far.
    pub const FAR: Self = Self { iterations: 16, rigidity: [1e-2, 1e-5], reach: [0.1, 0.006], ..Self::NEAR };
}

/// Holds what nothing else determines.
const START_WEIGHT: f64 = 1e-4;
/// Observed points that are matched back to the template in each iteration, at the most.
const MATCHED_BACK: usize = 5000;
/// Samples and observed points that face further apart, about 78°, do not match.
const MIN_COSINE: f64 = 0.2;
/// A fit ends early once the samples move by less than this share of the diagonal.
const MIN_MOVE: f64 = 1e-4;
/// Matches that count less than this share of what they could are of a surface out of reach.
const MIN_WEIGHT: f64 = 1e-6;
/// Steps of conjugate gradients in each iteration, at the most, and where they end.
const MAX_STEPS: usize = 12;
const TOLERANCE: f64 = 1e-4;
/// Keeps the preconditioner definite; over the squared diagonal, as all it is added to.
const RIDGE: f64 = 1e-9;

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
    /// No matches with a surface, before the first.
    pub fn unmatched(&self, target: &Target) -> KnownMatches {
        KnownMatches::none(self.samples.len(), target.points.len())
    }

    /// The cage that lays the template onto a surface, from a cage near it. Matches are looked for
    /// near the last ones. Runs on the current rayon pool; the result does not depend on it.
    pub fn fit(&self, target: &Target, start: &[Point], options: &FitOptions, known: &mut KnownMatches) -> Vec<Point> {
        self.fit_held(target, start, start, options, None, known).0
    }

    /// [`Self::fit`], held at another cage, with points that are pulled to their places; and
    /// whether the surface was in reach. Where not, nothing but anchors moves the cage.
    pub(crate) fn fit_held(
        &self,
        target: &Target,
        start: &[Point],
        reference: &[Point],
        options: &FitOptions,
        anchors: Option<&Anchors>,
        known: &mut KnownMatches,
    ) -> (Vec<Point>, bool) {
        let (reference, mut cage) = (vectors(reference), vectors(start));
        let area = self.diagonal * self.diagonal;
        let hold = options.hold / (area * cage.len() as f64);
        let every = (target.points.len() / MATCHED_BACK.min(target.points.len()).max(1)).max(1);
        let mut in_reach = true;
        for iteration in 0..options.iterations {
            let t = iteration as f64 / (options.iterations - 1).max(1) as f64;
            let between = |[first, last]: [f64; 2]| first * (last / first).powf(t);
            let weights = MatchWeights {
                total: 1.0 / area,
                reach: between(options.reach) * self.diagonal,
                min_cosine: MIN_COSINE,
                every,
                first: iteration % every,
            };
            let (points, normals) = self.samples_in(&cage);
            let distances = PlaneDistances::new((&points, &normals), target, &weights, known);
            // All matches, as shares of those one way, could count two. NaN is out of reach too.
            let weight = distances.hessians.iter().copied().map(trace).sum::<f64>() * area;
            in_reach = anchors.is_some() || weight >= 2.0 * MIN_WEIGHT;
            if !in_reach {
                break;
            }
            let held = Held { rigidity: between(options.rigidity), hold, anchors };
            let pull = || {
                let mut pull = self.coordinates.transposed_times(&distances.pulls);
                let rigid = self.rigidity.pull(&self.rigidity.positions(&cage));
                let reference = reference.iter().zip(&cage).map(|(to, from)| *to - *from);
                for ((pull, rigid), back) in pull.iter_mut().zip(rigid).zip(reference) {
                    *pull = *pull + held.rigidity * rigid + hold * back;
                }
                if let Some(anchors) = anchors {
                    pull.iter_mut().zip(anchors.pull(&cage, self.diagonal)).for_each(|(pull, by)| *pull += by);
                }
                pull
            };
            let (pull, factor) = rayon::join(pull, || self.preconditioner(weight / 3.0, held));
            let Some(factor) = factor else { break };
            let precondition = |r: &[DVec3]| {
                let mut z = matrix(r);
                solve_cholesky(factor.as_ref(), &mut z);
                row_points(z.as_ref())
            };
            let hessians: Vec<Mat3A> = distances.hessians.iter().map(|b| Mat3A::from(b.as_mat3())).collect();
            let times = |x: &[DVec3]| self.hessian_times(&hessians, held, x);
            let change = conjugate_gradients(pull, times, precondition, MAX_STEPS, TOLERANCE);
            let moved = self.sparse.times(&single(&change));
            cage.iter_mut().zip(&change).for_each(|(at, change)| *at += *change);
            let mean = moved.iter().map(|x| f64::from(x.length_squared())).sum::<f64>() / moved.len() as f64;
            if mean.sqrt() < MIN_MOVE * self.diagonal && iteration > options.iterations / 2 {
                break;
            }
        }
        (plain(&cage), in_reach)
    }

    /// The Cholesky factor of a Hessian in which every sample's is the mean of all.
    fn preconditioner(&self, mean: f64, held: Held<'_>) -> Option<Mat<f64>> {
        let mut sum = faer::Scale(mean) * &self.gram + faer::Scale(held.rigidity) * &self.rigidity.hessian;
        if let Some(anchors) = held.anchors {
            sum += anchors.hessian(self.diagonal);
        }
        let ridge = RIDGE / (self.diagonal * self.diagonal);
        (0..sum.nrows()).for_each(|k| sum[(k, k)] += held.hold + ridge);
        cholesky(sum)
    }

    /// The Hessian times a change of the cage, without small coordinates, in single precision.
    fn hessian_times(&self, hessians: &[Mat3A], held: Held<'_>, x: &[DVec3]) -> Vec<DVec3> {
        let change = single(x);
        let moved = self.sparse.times(&change);
        let pulled: Vec<Vec3A> = moved.iter().zip(hessians).map(|(&x, &b)| b * x).collect();
        let (sum, rigid) = (self.sparse.transposed_times(&pulled), self.rigidity.hessian_times(&change));
        let each = sum.iter().zip(&rigid).zip(x);
        let mut product: Vec<DVec3> =
            each.map(|((sum, rigid), x)| sum.as_dvec3() + held.rigidity * rigid.as_dvec3() + held.hold * *x).collect();
        if let Some(anchors) = held.anchors {
            let forces = anchors.hessian_times(x, self.diagonal);
            product.iter_mut().zip(forces).for_each(|(product, force)| *product += force);
        }
        product
    }
}

fn single(points: &[DVec3]) -> Vec<Vec3A> {
    points.iter().map(|p| p.as_vec3a()).collect()
}
