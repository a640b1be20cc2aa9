//! Conjugate gradients (Hestenes and Stiefel 1952) over displacements of points.

use glam::DVec3;

/// The solution of `A x = b`, from 0, in so many steps at the most, or until the preconditioned
/// squared residual is below this share of the first.
pub(crate) fn conjugate_gradients(
    mut residual: Vec<DVec3>,
    times: impl Fn(&[DVec3]) -> Vec<DVec3>,
    precondition: impl Fn(&[DVec3]) -> Vec<DVec3>,
    steps: usize,
    tolerance: f64,
) -> Vec<DVec3> {
    let inner = |a: &[DVec3], b: &[DVec3]| a.iter().zip(b).map(|(a, b)| a.dot(*b)).sum::<f64>();
    let mut x = vec![DVec3::ZERO; residual.len()];
    let mut direction = precondition(&residual);
    let first = inner(&residual, &direction);
    let mut size = first;
    for _ in 0..steps {
        let image = times(&direction);
        let curvature = inner(&direction, &image);
        if curvature.is_nan() || curvature <= 0.0 {
            break;
        }
        let step = size / curvature;
        x.iter_mut().zip(&direction).for_each(|(x, &d)| *x += step * d);
        residual.iter_mut().zip(&image).for_each(|(r, &image)| *r -= step * image);
        let z = precondition(&residual);
        let next = inner(&residual, &z);
        if next < tolerance * first {
            break;
        }
        direction.iter_mut().zip(&z).for_each(|(d, &z)| *d = z + next / size * *d);
        size = next;
    }
    x
}
