//! L-BFGS (Nocedal 1980) with a line search for sufficient decrease and curvature (Wolfe).

use lbfgs::Lbfgs;

/// Pairs of steps and changes of the gradient that are kept.
const MEMORY: usize = 10;
/// Share of the decrease that the slope promises, of which a step must do.
const DECREASE: f64 = 1e-4;
/// Share of the slope that may be left after a step.
const CURVATURE: f64 = 0.9;

/// Lowers `f(x)`, which writes its gradient, from `x`, in so many steps. Returns the last value.
pub(super) fn minimize(x: &mut Vec<f64>, steps: usize, mut f: impl FnMut(&[f64], &mut [f64]) -> f64) -> f64 {
    let n = x.len();
    let mut memory = Lbfgs::<f64>::new(n, MEMORY);
    let mut gradient = vec![0.0; n];
    let mut value = f(x, &mut gradient);
    let mut next_gradient = vec![0.0; n];
    for step in 0..steps {
        memory.update_hessian(&gradient, x);
        let mut direction = gradient.clone();
        memory.apply_hessian(&mut direction);
        let mut slope = -inner(&direction, &gradient);
        if slope.is_nan() || slope >= 0.0 {
            memory.reset();
            direction.clone_from(&gradient);
            slope = -inner(&gradient, &gradient);
        }
        let size = inner(&gradient, &gradient).sqrt();
        if size < 1e-6 {
            break;
        }
        // Steps along the plain gradient have no length of their own.
        let first = if step == 0 { (0.1 / size).min(1.0) } else { 1.0 };
        let (mut low, mut high, mut length) = (0.0, f64::INFINITY, first);
        let mut found = None;
        for _ in 0..25 {
            let at: Vec<f64> = x.iter().zip(&direction).map(|(x, d)| x - length * d).collect();
            let reached = f(&at, &mut next_gradient);
            if reached.is_nan() || reached > value + DECREASE * length * slope {
                high = length;
            } else {
                let left = -inner(&direction, &next_gradient);
                found = Some((at, reached, next_gradient.clone()));
                if left >= CURVATURE * slope {
                    break;
                }
                low = length;
            }
            length = if high.is_finite() { 0.5 * (low + high) } else { 2.0 * length };
        }
        let Some((at, reached, new_gradient)) = found else { break };
        let small = value - reached <= 1e-9 * value.abs().max(1.0);
        (*x, value, gradient) = (at, reached, new_gradient);
        if small {
            break;
        }
    }
    value
}

fn inner(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_bottom_of_a_curved_valley_is_found() {
        let mut x = vec![-1.2, 1.0];
        let value = minimize(&mut x, 200, |x, gradient| {
            let (a, b) = (1.0 - x[0], x[1] - x[0] * x[0]);
            gradient[0] = -2.0 * a - 400.0 * x[0] * b;
            gradient[1] = 200.0 * b;
            a * a + 100.0 * b * b
        });
        assert!(value < 1e-8 && (x[0] - 1.0).abs() < 1e-3, "{value} {x:?}");
    }
}
