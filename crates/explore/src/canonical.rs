//! A frame that turns with a shape, so that what is computed in it does not depend on how the shape was turned.

use cager_geometry::linalg::symmetric_eigen;
use cager_geometry::mesh::{Point, diagonal};
use glam::{DMat3, DVec3};

use crate::similarity::Similarity;

/// Moves the centre of some points to the origin and turns their principal axes onto the axes, each in the direction in which the points reach farther
/// (their third moment is positive).
pub(crate) fn canonical_frame(points: &[Point]) -> Similarity {
    let points: Vec<DVec3> = points.iter().map(|&p| p.into()).collect();
    let center = points.iter().sum::<DVec3>() / points.len().max(1) as f64;
    let mut covariance = [[0.0; 3]; 3];
    for point in &points {
        let d = (*point - center).to_array();
        (0..3).for_each(|i| (0..3).for_each(|j| covariance[i][j] += d[i] * d[j]));
    }
    let (_, axes) = symmetric_eigen(covariance);
    let [first, second] = [0, 1].map(|k| {
        let axis = DVec3::from(axes[k]);
        let skew: f64 = points.iter().map(|p| (*p - center).dot(axis).powi(3)).sum();
        if skew < 0.0 { -axis } else { axis }
    });
    let rotation = DMat3::from_cols(first, second, first.cross(second)).transpose();
    Similarity { rotation, scale: 1.0, translation: -(rotation * center) }
}

/// A length that says how large points are, however they are turned: the diagonal of their box along their principal axes.
pub(crate) fn size(points: &[Point]) -> f64 {
    diagonal(&canonical_frame(points).apply_all(points))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_size_of_a_stick_does_not_depend_on_its_direction() {
        let stick = |turn: f64| -> Vec<Point> {
            let rotation = DMat3::from_axis_angle(DVec3::new(1.0, 2.0, 3.0).normalize(), turn);
            let at = |k: u32| DVec3::new(f64::from(k * k), 0.1 * f64::from(k % 3), 0.05 * f64::from(k % 2));
            (0..10).map(|k| (rotation * at(k)).to_array()).collect()
        };
        for turn in [0.3, 1.0, 2.5] {
            assert!((size(&stick(turn)) / size(&stick(0.0)) - 1.0).abs() < 1e-9);
        }
    }
}
