//! Rotations, factors and translations in one.

use crate::points::{outer, trace};
use cager_geometry::linalg::nearest_rotation;
use cager_geometry::vector::Point;
use glam::{DMat3, DVec3};

/// `x → s R x + t`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Similarity {
    /// The rotation R.
    pub rotation: DMat3,
    /// The factor s.
    pub scale: f64,
    /// The translation t.
    pub translation: DVec3,
}

impl Similarity {
    /// What moves nothing.
    pub const IDENTITY: Self = Self { rotation: DMat3::IDENTITY, scale: 1.0, translation: DVec3::ZERO };

    /// Where a point goes.
    pub fn apply(&self, point: DVec3) -> DVec3 {
        self.scale * (self.rotation * point) + self.translation
    }

    /// Where points go.
    pub fn apply_all(&self, points: &[Point]) -> Vec<Point> {
        points.iter().map(|&p| self.apply(p.into()).to_array()).collect()
    }

    /// Where directions point.
    pub(crate) fn turn_all(&self, directions: &[Point]) -> Vec<Point> {
        directions.iter().map(|&n| (self.rotation * DVec3::from(n)).to_array()).collect()
    }

    /// First `first`, then this one.
    #[must_use]
    pub fn after(&self, first: &Self) -> Self {
        Self {
            rotation: self.rotation * first.rotation,
            scale: self.scale * first.scale,
            translation: self.apply(first.translation),
        }
    }

    /// The way back.
    #[must_use]
    pub fn inverse(&self) -> Self {
        let (rotation, scale) = (self.rotation.transpose(), 1.0 / self.scale);
        Self { rotation, scale, translation: -scale * (rotation * self.translation) }
    }

    /// The angle by which it turns, in radians, between 0 and π.
    pub fn angle(&self) -> f64 {
        (0.5 * (trace(self.rotation) - 1.0)).clamp(-1.0, 1.0).acos()
    }

    /// The one that brings points nearest to others in weighted least squares (Horn 1987), its
    /// factor within these bounds, turned about the axis `up` alone where there is one. None
    /// without weight.
    pub fn fitted(pairs: &[(DVec3, DVec3, f64)], up: Option<DVec3>, [least, most]: [f64; 2]) -> Option<Self> {
        let total: f64 = pairs.iter().map(|p| p.2).sum();
        if total.is_nan() || total <= 0.0 {
            return None;
        }
        let from = pairs.iter().map(|p| p.2 * p.0).sum::<DVec3>() / total;
        let to = pairs.iter().map(|p| p.2 * p.1).sum::<DVec3>() / total;
        let (mut covariance, mut size) = (DMat3::ZERO, 0.0);
        for &(p, q, weight) in pairs {
            let (p, q) = (p - from, weight * (q - to));
            covariance += outer(q, p);
            size += weight * p.length_squared();
        }
        let rotation = up.map_or_else(|| nearest_rotation(covariance), |up| turn_about(up, covariance));
        let trace = trace(covariance * rotation.transpose());
        let unfitted = if least > 0.0 { least } else { 1.0 };
        let scale = if size > 0.0 && trace > 0.0 { (trace / size).max(least).min(most) } else { unfitted };
        Some(Self { rotation, scale, translation: to - scale * (rotation * from) })
    }

    /// [`Self::fitted`], about any axis; sizes are kept where `scales` is false. The identity where
    /// nothing has a weight.
    pub fn between(pairs: &[(DVec3, DVec3, f64)], scales: bool) -> Self {
        Self::fitted(pairs, None, if scales { [0.0, f64::INFINITY] } else { [1.0; 2] }).unwrap_or(Self::IDENTITY)
    }

    /// [`Self::between`] of points in the same order, all of the same weight.
    pub fn of_points(from: &[Point], to: &[Point], scales: bool) -> Self {
        let pairs: Vec<_> = from.iter().zip(to).map(|(&p, &q)| (p.into(), q.into(), 1.0)).collect();
        Self::between(&pairs, scales)
    }
}

/// The turn about an axis that maximises `tr(Rᵀ A)`.
fn turn_about(up: DVec3, a: DMat3) -> DMat3 {
    let symmetric = trace(a) - up.dot(a * up);
    let skew = DVec3::new(a.y_axis.z - a.z_axis.y, a.z_axis.x - a.x_axis.z, a.x_axis.y - a.y_axis.x);
    DMat3::from_axis_angle(up, skew.dot(up).atan2(symmetric))
}
