//! Axis-aligned bounding boxes.

use glam::DVec3;

/// An axis-aligned box, closed on all sides.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Aabb {
    /// Least coordinates.
    pub low: DVec3,
    /// Greatest coordinates.
    pub high: DVec3,
}

impl Aabb {
    /// The box that holds nothing.
    pub const EMPTY: Self = Self { low: DVec3::INFINITY, high: DVec3::NEG_INFINITY };

    /// The least box around some points; coordinates that are NaN count for nothing.
    pub fn around(points: impl IntoIterator<Item = DVec3>) -> Self {
        // `DVec3::min` may give the NaN, and the box of all before it would be lost.
        let each = |f: fn(f64, f64) -> f64, a: DVec3, b: DVec3| DVec3::new(f(a.x, b.x), f(a.y, b.y), f(a.z, b.z));
        points
            .into_iter()
            .fold(Self::EMPTY, |b, p| Self { low: each(f64::min, b.low, p), high: each(f64::max, b.high, p) })
    }

    /// The least box around both.
    #[must_use]
    pub fn union(&self, other: &Self) -> Self {
        Self { low: self.low.min(other.low), high: self.high.max(other.high) }
    }

    /// The box with every side moved outwards.
    #[must_use]
    pub fn grown(&self, margin: f64) -> Self {
        Self { low: self.low - margin, high: self.high + margin }
    }

    /// Whether the boxes have a point in common; touching is enough.
    pub fn overlaps(&self, other: &Self) -> bool {
        self.low.cmple(other.high).all() && other.low.cmple(self.high).all()
    }

    /// Squared distance from a point, zero inside.
    pub fn distance2(&self, p: DVec3) -> f64 {
        (self.low - p).max(p - self.high).max(DVec3::ZERO).length_squared()
    }

    /// The middle of the box.
    pub fn center(&self) -> DVec3 {
        0.5 * (self.low + self.high)
    }

    /// Extent along each axis.
    pub fn size(&self) -> DVec3 {
        self.high - self.low
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn coordinates_that_are_no_numbers_do_not_lose_the_box() {
        let points = [DVec3::ZERO, DVec3::new(f64::NAN, 2.0, -1.0), DVec3::ONE];
        for shift in 0..3 {
            let turned = (0..3).map(|k| points[(k + shift) % 3]);
            assert_eq!(Aabb::around(turned), Aabb { low: DVec3::new(0.0, 0.0, -1.0), high: DVec3::new(1.0, 2.0, 1.0) });
        }
    }
}
