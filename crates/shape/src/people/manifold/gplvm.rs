//! Gaussian process latent variable models of poses (Lawrence 2005; Duveau et al. 2012, §4) with
//! back-constraints (Lawrence and Quiñonero-Candela 2006): latent numbers are kernel functions of
//! the poses, so that similar poses stay together.
//!
//! `X = K_b A` with `K_b = exp(−d² / 2 d̃²)` over weighted poses, `d̃` their median distance. `A`,
//! α, γ and the noise 1/β minimise `D/2 log |K| + ½ tr(K⁻¹ Y Yᵀ) + ½ ‖X‖²` with `K = α exp(−γ/2 ‖x
//! − x'‖²) + δ/β`, by L-BFGS from the principal components.

use super::descent::minimize;
use super::error::ManifoldError;
use super::{Examples, Pca, PoseWeights};

use crate::people::rig::QUAD_UNKNOWNS;
use cager_geometry::linalg::{cholesky, product, solve_cholesky, zeros};
use faer::Mat;
use serde::{Deserialize, Serialize};

/// Steps of L-BFGS at the most.
const STEPS: usize = 250;
/// What is added to the variance of the noise, so that the covariance stays definite.
const JITTER: f64 = 1e-6;

/// A nonlinear manifold of poses.
#[derive(Clone, Debug, Deserialize, Serialize)]
#[serde(try_from = "Stored", into = "Stored")]
pub struct Gplvm {
    stored: Stored,
    /// `K⁻¹`.
    inverse: Mat<f64>,
    /// `K⁻¹ Y`.
    weights: Mat<f64>,
}

/// What files contain.
#[derive(Clone, Debug, Deserialize, Serialize)]
struct Stored {
    latent: Vec<Vec<f64>>,
    alpha: f64,
    gamma: f64,
    beta: f64,
    /// What the model's numbers are multiplied with, before the weights are taken out.
    scale: f64,
    pose_weights: PoseWeights,
    mean: Vec<f64>,
    /// The examples, centred, weighted and over the scale.
    poses: Vec<Vec<f64>>,
}

impl From<Gplvm> for Stored {
    fn from(model: Gplvm) -> Self {
        model.stored
    }
}

impl TryFrom<Stored> for Gplvm {
    /// What is wrong with a file, for [`ManifoldError::Syntax`].
    type Error = String;

    fn try_from(stored: Stored) -> Result<Self, String> {
        let PoseWeights { position, rotation } = stored.pose_weights;
        let scales = [
            ("alpha", stored.alpha),
            ("gamma", stored.gamma),
            ("beta", stored.beta),
            ("scale", stored.scale),
            ("pose_weights.position", position),
            ("pose_weights.rotation", rotation),
        ];
        if let Some((name, value)) = scales.into_iter().find(|&(_, value)| !(value > 0.0 && value.is_finite())) {
            return Err(format!("its {name} is {value}, not above zero"));
        }
        let n = stored.latent.len();
        let dims = stored.latent.first().map_or(0, Vec::len);
        let wrong = || "its numbers do not fit together".to_owned();
        let fits = dims > 0
            && stored.poses.len() == n
            && stored.mean.len() == QUAD_UNKNOWNS
            && stored.latent.iter().all(|x| x.len() == dims)
            && stored.poses.iter().all(|y| y.len() == QUAD_UNKNOWNS);
        if !fits {
            return Err(wrong());
        }
        let x = Mat::from_fn(n, dims, |i, k| stored.latent[i][k]);
        let y = Mat::from_fn(n, QUAD_UNKNOWNS, |i, j| stored.poses[i][j]);
        let theta = [stored.alpha.ln(), stored.gamma.ln(), stored.beta.ln()];
        let inverse = Covariance::new(&x, theta).ok_or_else(wrong)?.inverse;
        let weights = product(inverse.as_ref(), y.as_ref());
        Ok(Self { stored, inverse, weights })
    }
}

impl Gplvm {
    /// Learns a model with so many latent numbers.
    ///
    /// # Errors
    /// Where there are not more poses than these.
    pub fn learn(examples: &Examples, dims: usize) -> Result<Self, ManifoldError> {
        let start = Pca::learn(examples, dims)?.latent;
        let n = examples.len();
        let scale = (examples.centered.squared_norm_l2() / (n * QUAD_UNKNOWNS) as f64).sqrt();
        let y = Mat::from_fn(n, QUAD_UNKNOWNS, |i, j| examples.centered[(i, j)] / scale);
        let problem = Problem::new(&y, dims);
        let mut unknowns = problem.start(&start).ok_or(ManifoldError::NotFinite)?;
        minimize(&mut unknowns, STEPS, |v, gradient| problem.cost(v, gradient));
        let theta: Vec<f64> = unknowns[n * dims..].iter().map(|t| t.exp()).collect();
        let x = problem.latent(&unknowns);
        Self::try_from(Stored {
            latent: (0..n).map(|i| (0..dims).map(|k| x[(i, k)]).collect()).collect(),
            alpha: theta[0],
            gamma: theta[1],
            beta: theta[2],
            scale,
            pose_weights: examples.weights,
            mean: examples.mean.clone(),
            poses: (0..n).map(|i| (0..QUAD_UNKNOWNS).map(|j| y[(i, j)]).collect()).collect(),
        })
        .map_err(ManifoldError::Syntax)
    }

    /// Latent numbers.
    pub fn dims(&self) -> usize {
        self.stored.latent[0].len()
    }

    /// Those of the examples.
    pub fn latents(&self) -> &[Vec<f64>] {
        &self.stored.latent
    }

    /// The pose of latent numbers.
    pub fn pose(&self, x: &[f64]) -> Vec<f64> {
        let k = self.kernel(x);
        (0..QUAD_UNKNOWNS).map(|j| self.stored.mean[j] + self.output(&k, j)).collect()
    }

    /// Derivatives of the pose, one vector for each latent number.
    pub fn jacobian(&self, x: &[f64]) -> Vec<Vec<f64>> {
        let derivatives = self.kernel_derivatives(x);
        derivatives.iter().map(|dk| (0..QUAD_UNKNOWNS).map(|j| self.output(dk, j)).collect()).collect()
    }

    /// Variance of a normalised number of the pose, and its derivatives (Eq. 9 and 10).
    pub fn variance(&self, x: &[f64]) -> (f64, Vec<f64>) {
        let k = self.kernel(x);
        let n = k.len();
        let solved: Vec<f64> = (0..n).map(|i| (0..n).map(|j| self.inverse[(i, j)] * k[j]).sum()).collect();
        let explained: f64 = k.iter().zip(&solved).map(|(a, b)| a * b).sum();
        let variance = (self.stored.alpha + 1.0 / self.stored.beta - explained).max(1e-9);
        let by = |dk: &Vec<f64>| -2.0 * dk.iter().zip(&solved).map(|(a, b)| a * b).sum::<f64>();
        (variance, self.kernel_derivatives(x).iter().map(by).collect())
    }

    /// The least variance there can be: that of the noise.
    pub(super) fn noise_variance(&self) -> f64 {
        1.0 / self.stored.beta + JITTER
    }

    fn output(&self, k: &[f64], j: usize) -> f64 {
        let sum: f64 = k.iter().zip(self.weights.col(j).iter()).map(|(k, w)| k * w).sum();
        sum * self.stored.scale / self.stored.pose_weights.at(j)
    }

    fn kernel(&self, x: &[f64]) -> Vec<f64> {
        let value = |example: &Vec<f64>| {
            let r2: f64 = example.iter().zip(x).map(|(a, b)| (a - b) * (a - b)).sum();
            self.stored.alpha * (-0.5 * self.stored.gamma * r2).exp()
        };
        self.stored.latent.iter().map(value).collect()
    }

    fn kernel_derivatives(&self, x: &[f64]) -> Vec<Vec<f64>> {
        let k = self.kernel(x);
        let along = |d: usize| {
            let of = |(k, example): (&f64, &Vec<f64>)| -self.stored.gamma * k * (x[d] - example[d]);
            k.iter().zip(&self.stored.latent).map(of).collect()
        };
        (0..x.len()).map(along).collect()
    }
}

/// `K`, what it consists of, and its inverse.
struct Covariance {
    /// Without the noise.
    smooth: Mat<f64>,
    inverse: Mat<f64>,
    /// Half the logarithm of its determinant.
    half_log_determinant: f64,
}

impl Covariance {
    /// Of latent numbers, one row each, and log α, γ, β; `None` where it is not definite.
    fn new(x: &Mat<f64>, [alpha, gamma, beta]: [f64; 3]) -> Option<Self> {
        let n = x.nrows();
        let (alpha, gamma) = (alpha.exp(), gamma.exp());
        let smooth = Mat::from_fn(n, n, |i, j| alpha * (-0.5 * gamma * distance2(x, i, j)).exp());
        let noise = (-beta).exp() + JITTER;
        let factor = cholesky(Mat::from_fn(n, n, |i, j| smooth[(i, j)] + if i == j { noise } else { 0.0 }))?;
        let half_log_determinant = (0..n).map(|i| factor[(i, i)].ln()).sum();
        let mut inverse = Mat::identity(n, n);
        solve_cholesky(factor.as_ref(), &mut inverse);
        Some(Self { smooth, inverse, half_log_determinant })
    }
}

fn distance2(x: &Mat<f64>, i: usize, j: usize) -> f64 {
    (0..x.ncols()).map(|k| (x[(i, k)] - x[(j, k)]).powi(2)).sum()
}

/// The learning problem over `A`, column by column, and the logarithms of α, γ and β.
struct Problem {
    dims: usize,
    /// `K_b`.
    back: Mat<f64>,
    /// `Y Yᵀ`.
    moments: Mat<f64>,
}

impl Problem {
    fn new(y: &Mat<f64>, dims: usize) -> Self {
        let n = y.nrows();
        let distances = Mat::from_fn(n, n, |i, j| distance2(y, i, j));
        let mut sorted: Vec<f64> = (0..n).flat_map(|j| (0..n).map(move |i| (i, j))).map(|at| distances[at]).collect();
        sorted.sort_unstable_by(f64::total_cmp);
        let median = sorted[sorted.len() / 2].max(f64::MIN_POSITIVE);
        let back = Mat::from_fn(n, n, |i, j| (-0.5 * distances[(i, j)] / median).exp());
        Self { dims, back, moments: product(y.as_ref(), y.transpose()) }
    }

    /// `A` for these latent numbers, and the first α, γ and β.
    fn start(&self, latent: &[Vec<f64>]) -> Option<Vec<f64>> {
        let n = self.back.nrows();
        let factor = cholesky(Mat::from_fn(n, n, |i, j| self.back[(i, j)] + if i == j { 1e-3 } else { 0.0 }))?;
        let mut a = Mat::from_fn(n, self.dims, |i, k| latent[i][k]);
        solve_cholesky(factor.as_ref(), &mut a);
        let mut unknowns: Vec<f64> =
            (0..self.dims).flat_map(|k| a.col(k).iter().copied().collect::<Vec<_>>()).collect();
        unknowns.extend([0.0, 0.5_f64.ln(), 50.0_f64.ln()]);
        Some(unknowns)
    }

    fn latent(&self, unknowns: &[f64]) -> Mat<f64> {
        let n = self.back.nrows();
        product(self.back.as_ref(), Mat::from_fn(n, self.dims, |i, k| unknowns[k * n + i]).as_ref())
    }

    /// The cost for each pose, and its gradient; infinite where the covariance is not definite.
    fn cost(&self, unknowns: &[f64], gradient: &mut [f64]) -> f64 {
        let (n, q) = (self.back.nrows(), self.dims);
        let outputs = QUAD_UNKNOWNS as f64;
        let theta = [unknowns[n * q], unknowns[n * q + 1], unknowns[n * q + 2]];
        let x = self.latent(unknowns);
        let Some(covariance) = Covariance::new(&x, theta) else { return f64::INFINITY };
        let inverse = covariance.inverse.as_ref();
        let solved = product(inverse, self.moments.as_ref());
        let trace: f64 = (0..n).map(|i| solved[(i, i)]).sum();
        let again = product(solved.as_ref(), inverse);
        // The derivative by the entries of K.
        let by_entry = |i: usize, j: usize| 0.5 * (outputs * inverse[(i, j)] - again[(i, j)]);
        let (gamma, noise) = (theta[1].exp(), (-theta[2]).exp());
        let mut by_latent: Mat<f64> = zeros(n, q);
        let mut by_theta = [0.1 * theta[0], 0.1 * theta[1], 0.1 * theta[2]];
        for j in 0..n {
            for i in 0..n {
                let weighted = by_entry(i, j) * covariance.smooth[(i, j)];
                by_theta[0] += weighted;
                by_theta[1] -= 0.5 * gamma * weighted * distance2(&x, i, j);
                for k in 0..q {
                    by_latent[(i, k)] -= 2.0 * gamma * weighted * (x[(i, k)] - x[(j, k)]);
                }
            }
            by_theta[2] -= noise * by_entry(j, j);
        }
        by_latent += &x;
        let by_a = product(self.back.transpose(), by_latent.as_ref());
        let each = 1.0 / n as f64;
        for k in 0..q {
            for i in 0..n {
                gradient[k * n + i] = by_a[(i, k)] * each;
            }
        }
        (0..3).for_each(|k| gradient[n * q + k] = by_theta[k] * each);
        let hyper: f64 = theta.iter().map(|t| 0.05 * t * t).sum();
        (outputs * covariance.half_log_determinant + 0.5 * trace + 0.5 * x.squared_norm_l2() + hyper) * each
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_gradient_of_learning_equals_central_differences() {
        let mut random = fastrand::Rng::with_seed(5);
        let y = Mat::from_fn(9, QUAD_UNKNOWNS, |i, j| ((i + 1) as f64 * 0.3 + j as f64).sin() + 0.1 * random.f64());
        let problem = Problem::new(&y, 2);
        let mut at: Vec<f64> = (0..9 * 2 + 3).map(|_| random.f64() - 0.5).collect();
        let mut gradient = vec![0.0; at.len()];
        problem.cost(&at, &mut gradient);
        let mut unused = gradient.clone();
        for k in 0..at.len() {
            let (x, step) = (at[k], 1e-5);
            let mut cost = |x: f64| {
                at[k] = x;
                problem.cost(&at, &mut unused)
            };
            let difference = (cost(x + step) - cost(x - step)) / (2.0 * step);
            at[k] = x;
            assert!(
                (difference - gradient[k]).abs() < 1e-6 * difference.abs().max(1.0),
                "{k}: {difference} {}",
                gradient[k]
            );
        }
    }

    #[test]
    fn scales_of_a_file_that_are_not_above_zero_are_refused_by_name() {
        let stored = |scale: f64, rotation: f64, alpha: f64| Stored {
            latent: vec![vec![0.0], vec![1.0]],
            alpha,
            gamma: 1.0,
            beta: 100.0,
            scale,
            pose_weights: PoseWeights { position: 10.0, rotation },
            mean: vec![0.0; QUAD_UNKNOWNS],
            poses: vec![vec![0.0; QUAD_UNKNOWNS], vec![1.0; QUAD_UNKNOWNS]],
        };
        assert!(Gplvm::try_from(stored(0.1, 1.5, 1.0)).is_ok());
        for (file, expected) in [
            (stored(0.0, 1.5, 1.0), "its scale is 0, not above zero"),
            (stored(0.1, 0.0, 1.0), "its pose_weights.rotation is 0, not above zero"),
            (stored(0.1, 1.5, -1.0), "its alpha is -1, not above zero"),
        ] {
            assert_eq!(Gplvm::try_from(file).unwrap_err(), expected);
        }
    }
}
