//! Weighted least squares over some unknowns: normal equations, damped and solved.

use cager_geometry::linalg::{gram, solve_definite};
use faer::Mat;

/// `A δ = −b` with `A = Σ JᵀJ` and `b = Σ Jᵀ r`.
pub(super) struct NormalEquations {
    /// The lower triangle.
    a: Mat<f64>,
    b: Vec<f64>,
}

/// Rows of a product that one task adds up.
const BLOCK: usize = 512;
/// Share of its diagonal that is added to `A` (Levenberg–Marquardt).
const DAMPING: f64 = 1e-3;

impl NormalEquations {
    /// Of residuals and their derivatives, one column each, both times the root of their weight.
    pub(super) fn new(derivatives: &Mat<f64>, residuals: &[f64]) -> Self {
        let a = gram(derivatives.transpose(), BLOCK);
        let mut b = vec![0.0; derivatives.nrows()];
        for (j, r) in residuals.iter().enumerate() {
            b.iter_mut().zip(derivatives.col_as_slice(j)).for_each(|(b, d)| *b += d * r);
        }
        Self { a, b }
    }

    /// Adds a residual with few derivatives, in ascending order of the unknowns.
    pub(super) fn add(&mut self, residual: f64, derivatives: &[(usize, f64)]) {
        for (k, &(i, d)) in derivatives.iter().enumerate() {
            self.b[i] += d * residual;
            for &(j, e) in &derivatives[..=k] {
                self.a[(i, j)] += d * e;
            }
        }
    }

    /// The step; none where the equations have no solution.
    pub(super) fn step(mut self) -> Option<Vec<f64>> {
        let n = self.b.len();
        for i in 0..n {
            self.a[(i, i)] += DAMPING * (self.a[(i, i)] + 1e-9);
        }
        let right = Mat::from_fn(n, 1, |i, _| -self.b[i]);
        let step = solve_definite(self.a, right)?;
        let step: Vec<f64> = step.col(0).iter().copied().collect();
        step.iter().all(|x| x.is_finite()).then_some(step)
    }
}
