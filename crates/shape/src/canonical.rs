//! A frame that turns with a shape, so that results in it do not depend on how it was turned.

use cager_geometry::mesh::Point;
use glam::{DMat3, DVec3};

use crate::points::Moments;
use crate::similarity::Similarity;

/// Moves the centre of points to the origin and turns principal axes onto the axes, each in the
/// direction in which the points reach farther (their third moment is positive).
pub(crate) fn canonical_frame(points: &[Point]) -> Similarity {
    let Moments { center, axes, .. } = Moments::new(points);
    let [first, second] = [0, 1].map(|k| {
        let axis = axes[k];
        let skew: f64 = points.iter().map(|&p| (DVec3::from(p) - center).dot(axis).powi(3)).sum();
        if skew < 0.0 { -axis } else { axis }
    });
    let rotation = DMat3::from_cols(first, second, first.cross(second)).transpose();
    Similarity { rotation, scale: 1.0, translation: -(rotation * center) }
}

/// The size of points, however turned: the diagonal of a box with their second moments, `√(12 tr
/// Σ)`.
pub(crate) fn size(points: &[Point]) -> f64 {
    (12.0 * Moments::new(points).variances.iter().sum::<f64>()).max(0.0).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_size_of_any_shape_does_not_depend_on_how_it_is_turned() {
        let stick = |k: u32| DVec3::new(f64::from(k * k), 0.1 * f64::from(k % 3), 0.05 * f64::from(k % 2));
        let cube = |k: u32| DVec3::new(f64::from(k & 1), f64::from(k >> 1 & 1), f64::from(k >> 2 & 1));
        let ring = |k: u32| DVec3::new(f64::from(k).cos(), f64::from(k).sin(), 0.0);
        let mut random = fastrand::Rng::with_seed(12);
        for (what, shape) in [
            ("stick", (0..10).map(stick).collect::<Vec<_>>()),
            // No principal axes of their own.
            ("cube", (0..8).map(cube).collect()),
            ("ring", (0..40).map(ring).collect()),
        ] {
            let plain: Vec<Point> = shape.iter().map(DVec3::to_array).collect();
            for _ in 0..50 {
                let axis = DVec3::from_array(std::array::from_fn(|_| random.f64() - 0.5)).normalize();
                let rotation = DMat3::from_axis_angle(axis, 6.0 * random.f64());
                let turned: Vec<Point> = shape.iter().map(|&p| (rotation * p).to_array()).collect();
                assert!(
                    (size(&turned) / size(&plain) - 1.0).abs() < 1e-12,
                    "{what}: {} {}",
                    size(&turned),
                    size(&plain)
                );
            }
        }
    }
}
