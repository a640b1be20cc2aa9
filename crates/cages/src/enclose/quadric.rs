//! Quadric error metrics (Garland and Heckbert 1997).

use glam::{DMat3, DVec3};
use std::ops::AddAssign;

/// Weight of the distance from the vertices that were merged, beside that from their faces' planes:
/// it places vertices evenly where the surface is flat.
const EVENNESS: f64 = 0.01;

/// A sum of squared distances weighted by area: xᵀ A x + 2 bᵀ x + c.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Quadric {
    a: DMat3,
    b: DVec3,
    c: f64,
    area: f64,
}

impl Quadric {
    /// No distances.
    pub(super) const ZERO: Self = Self { a: DMat3::ZERO, b: DVec3::ZERO, c: 0.0, area: 0.0 };

    /// A third of a face's share: distance to its plane, and to one corner.
    pub(super) fn of_corner(corners: [DVec3; 3], corner: usize) -> Self {
        let cross = (corners[1] - corners[0]).cross(corners[2] - corners[0]);
        let area = cross.length() / 6.0;
        let n = cross.normalize_or_zero();
        let (at, d) = (corners[corner], n.dot(corners[0]));
        let plane = DMat3::from_cols(n * n.x, n * n.y, n * n.z);
        Self {
            a: (plane + DMat3::from_diagonal(DVec3::splat(EVENNESS))) * area,
            b: -(n * d + at * EVENNESS) * area,
            c: (d * d + at.length_squared() * EVENNESS) * area,
            area,
        }
    }

    /// Value at a point.
    pub(super) fn at(&self, x: DVec3) -> f64 {
        (x.dot(self.a * x) + 2.0 * self.b.dot(x) + self.c).max(0.0)
    }

    /// Where the value is least, with the distance from `anchor` added with a weight.
    pub(super) fn least(&self, anchor: DVec3, weight: f64) -> DVec3 {
        let w = weight * self.area;
        let a = self.a + DMat3::from_diagonal(DVec3::splat(w));
        let trace = a.x_axis.x + a.y_axis.y + a.z_axis.z;
        if a.determinant() > 1e-9 * trace.powi(3) { a.inverse() * (anchor * w - self.b) } else { anchor }
    }
}

impl AddAssign for Quadric {
    fn add_assign(&mut self, other: Self) {
        self.a += other.a;
        self.b += other.b;
        self.c += other.c;
        self.area += other.area;
    }
}
