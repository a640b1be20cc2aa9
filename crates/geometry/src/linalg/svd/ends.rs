//! The largest and the smallest singular value alone, by the method of Lanczos (1950) with every
//! vector kept orthogonal to all before: some dozens of products.

use crate::linalg;
use faer::{Mat, MatRef};

/// Steps that the method takes at the most.
const MAX_STEPS: usize = 240;
/// It ends when as many steps change the value by less than this fraction.
const SETTLED: f64 = 1e-11;
const UNCHANGED: usize = 4;

/// Largest and smallest singular value of A, m × m, with its inverse.
pub fn ends(a: MatRef<'_, f64>, inverse: MatRef<'_, f64>) -> [f64; 2] {
    let (first, last) = rayon::join(|| first_value(a), || 1.0 / first_value(inverse));
    [first, last]
}

/// Largest singular value of a matrix, m × m.
pub fn first_value(a: MatRef<'_, f64>) -> f64 {
    largest(a.ncols(), |x| linalg::product(a.transpose(), linalg::product(a, x).as_ref())).sqrt()
}

/// Largest eigenvalue of a symmetric positive operator on vectors of length m, given as columns.
fn largest(m: usize, apply: impl Fn(MatRef<'_, f64>) -> Mat<f64>) -> f64 {
    let steps = MAX_STEPS.min(m);
    let mut basis = Mat::<f64>::zeros(m, steps + 1);
    let mut random = fastrand::Rng::with_seed(0);
    basis.col_mut(0).iter_mut().for_each(|x| *x = random.f64() - 0.5);
    let norm = basis.col(0).norm_l2();
    basis.col_mut(0).iter_mut().for_each(|x| *x /= norm);
    let (mut diagonal, mut off_diagonal) = (Vec::new(), Vec::new());
    let (mut value, mut unchanged) = (0.0, 0);
    for k in 0..steps {
        let mut next = apply(basis.as_ref().subcols(k, 1));
        let known = basis.as_ref().subcols(0, k + 1);
        // Twice is enough (Kahan and Parlett).
        for pass in 0..2 {
            let along = linalg::product(known.transpose(), next.as_ref());
            if pass == 0 {
                diagonal.push(along[(k, 0)]);
            }
            next -= linalg::product(known, along.as_ref());
        }
        let now = largest_of_tridiagonal(&diagonal, &off_diagonal);
        unchanged = if (now - value).abs() <= SETTLED * now { unchanged + 1 } else { 0 };
        value = now;
        let length = next.norm_l2();
        if unchanged >= UNCHANGED || length.is_nan() || length <= f64::EPSILON * now {
            break;
        }
        off_diagonal.push(length);
        for (to, &x) in basis.col_mut(k + 1).iter_mut().zip(next.col(0).iter()) {
            *to = x / length;
        }
    }
    value
}

/// Largest eigenvalue of a symmetric tridiagonal matrix, by bisection on the signs of its pivots.
fn largest_of_tridiagonal(diagonal: &[f64], off_diagonal: &[f64]) -> f64 {
    let radius = |i: usize| {
        let before = if i > 0 { off_diagonal[i - 1].abs() } else { 0.0 };
        before + off_diagonal.get(i).filter(|_| i + 1 < diagonal.len()).map_or(0.0, |x| x.abs())
    };
    let (mut low, mut high) = (diagonal.iter().copied().fold(f64::NEG_INFINITY, f64::max), f64::NEG_INFINITY);
    for (i, &d) in diagonal.iter().enumerate() {
        high = high.max(d + radius(i));
    }
    let is_above_all = |x: f64| {
        let mut pivot = f64::INFINITY;
        diagonal.iter().enumerate().all(|(i, &d)| {
            let before = if i > 0 { off_diagonal[i - 1] } else { 0.0 };
            pivot = x - d - before * before / pivot;
            pivot > 0.0
        })
    };
    for _ in 0..100 {
        let middle = low.midpoint(high);
        if middle <= low || middle >= high {
            break;
        }
        if is_above_all(middle) { high = middle } else { low = middle }
    }
    high
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::linalg::svd::singular_values;

    #[test]
    fn the_iterations_begin_with_the_same_vectors_for_ever() {
        let mut random = fastrand::Rng::with_seed(0);
        let values = [11_116_517_241_604_665_558, 91_298_403_691_422_709, 1_747_996_488_805_885_078];
        assert_eq!(values.map(|_| random.u64(..)), values);
    }

    #[test]
    fn the_ends_are_those_of_the_decomposition() {
        for m in [1, 2, 3, 20, 150] {
            let a = Mat::from_fn(m, m, |i, j| {
                ((i * 31 + j * 17 + i * j) % 23) as f64 / (1 + i + 2 * j) as f64 + if i == j { 3.0 } else { 0.0 }
            });
            let inverse = linalg::inverse(a.as_ref()).0;
            let all = singular_values(a.as_ref()).unwrap();
            let [first, last] = ends(a.as_ref(), inverse.as_ref());
            assert!((first / all[0] - 1.0).abs() < 1e-12, "{m}: {first} {}", all[0]);
            assert!((last / all[m - 1] - 1.0).abs() < 1e-9, "{m}: {last} {}", all[m - 1]);
        }
    }
}
