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
        // `DVec3::min` may give the NaN; comparisons with it are false.
        points.into_iter().fold(Self::EMPTY, |b, p| Self {
            low: DVec3::select(p.cmplt(b.low), p, b.low),
            high: DVec3::select(p.cmpgt(b.high), p, b.high),
        })
    }

    /// As [`Self::around`], of points in memory: several at a time.
    pub fn around_all(points: &[[f64; 3]]) -> Self {
        const LANES: usize = 24;
        let (chunks, rest) = points.as_flattened().as_chunks::<LANES>();
        let (mut low, mut high) = ([f64::INFINITY; LANES], [f64::NEG_INFINITY; LANES]);
        for chunk in chunks {
            for i in 0..LANES {
                low[i] = if chunk[i] < low[i] { chunk[i] } else { low[i] };
                high[i] = if chunk[i] > high[i] { chunk[i] } else { high[i] };
            }
        }
        let points = |values: &[f64]| Self::around(values.as_chunks().0.iter().map(|&p| DVec3::from_array(p)));
        let rest = points(rest);
        Self { low: points(&low).low.min(rest.low), high: points(&high).high.max(rest.high) }
    }

    /// The least box around both.
    #[must_use]
    #[inline]
    pub fn union(&self, other: &Self) -> Self {
        Self { low: self.low.min(other.low), high: self.high.max(other.high) }
    }

    /// The box with every side moved outwards.
    #[must_use]
    #[inline]
    pub fn grown(&self, margin: f64) -> Self {
        Self { low: self.low - margin, high: self.high + margin }
    }

    /// Whether the boxes have a point in common; touching is enough.
    #[inline]
    pub fn overlaps(&self, other: &Self) -> bool {
        self.low.cmple(other.high).all() && other.low.cmple(self.high).all()
    }

    /// Squared distance from a point, zero inside.
    #[inline]
    pub fn distance2(&self, p: DVec3) -> f64 {
        (self.low - p).max(p - self.high).max(DVec3::ZERO).length_squared()
    }

    /// Squared distance of another box's farthest corner, zero where it is inside.
    #[inline]
    pub fn max_distance2(&self, other: &Self) -> f64 {
        (self.low - other.low).max(other.high - self.high).max(DVec3::ZERO).length_squared()
    }

    /// The middle of the box.
    #[inline]
    pub fn center(&self) -> DVec3 {
        0.5 * (self.low + self.high)
    }

    /// Extent along each axis.
    #[inline]
    pub fn size(&self) -> DVec3 {
        self.high - self.low
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn many_points_have_the_box_of_one_after_the_other() {
        let mut random = fastrand::Rng::with_seed(3);
        for count in [0, 1, 7, 8, 9, 40] {
            let mut points: Vec<[f64; 3]> = (0..count).map(|_| [0; 3].map(|_| random.f64() - 0.5)).collect();
            if let Some(point) = points.get_mut(6) {
                point[1] = f64::NAN;
            }
            assert_eq!(Aabb::around_all(&points), Aabb::around(points.iter().map(|&p| p.into())), "{count} points");
        }
    }

    #[test]
    fn coordinates_that_are_no_numbers_do_not_lose_the_box() {
        let points = [DVec3::ZERO, DVec3::new(f64::NAN, 2.0, -1.0), DVec3::ONE];
        for shift in 0..3 {
            let turned = (0..3).map(|k| points[(k + shift) % 3]);
            assert_eq!(Aabb::around(turned), Aabb { low: DVec3::new(0.0, 0.0, -1.0), high: DVec3::new(1.0, 2.0, 1.0) });
        }
    }
}
