//! Captures far from the origin of their coordinates, as in UTM metres: cages in single precision
//! would lose them, so they are encoded about an origin of their own, which the container keeps.

use cager_geometry::mesh::{Point, bounds};
use cager_geometry::vector::{add, distance, middle, sub};

/// Diagonals from which on an origin is taken: single precision resolves less than 1e-5 there.
pub const FAR: f64 = 100.0;

/// What single precision may lose of a diagonal without being seen.
pub const MAX_ROUNDING_ERROR: f64 = 1e-4;

/// An origin near the middle of a rest pose that lies far away; `None` for all others. In whole
/// units, or the largest power of two that is not above the diagonal where that is less than one,
/// so that subtracting it from doubles loses nothing.
pub fn own_origin(rest: &[Point]) -> Option<Point> {
    let (low, high) = bounds(rest);
    let (diagonal, centre) = (distance(low, high), middle(low, high));
    let far = centre.iter().any(|x| x.abs() > FAR * diagonal);
    let step = f64::from_bits(diagonal.to_bits() & f64::INFINITY.to_bits()).min(1.0);
    let origin = centre.map(|x| (x / step).round() * step);
    (far && step > 0.0 && origin.iter().all(|x| x.is_finite())).then_some(origin)
}

/// Moves points into the coordinates of an origin.
pub fn move_to(origin: Option<Point>, points: &mut [Point]) {
    if let Some(origin) = origin {
        points.iter_mut().for_each(|p| *p = sub(*p, origin));
    }
}

/// Moves points out of the coordinates of an origin.
pub fn move_from(origin: Option<Point>, points: &mut [Point]) {
    if let Some(origin) = origin {
        points.iter_mut().for_each(|p| *p = add(*p, origin));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_what_lies_far_away_for_its_size_gets_an_origin() {
        let at = |x: f64, size: f64| own_origin(&[[x, 0.0, 0.0], [x + size, 0.0, 0.0]]);
        assert_eq!(at(0.0, 1.0), None);
        assert_eq!(at(90.0, 1.0), None);
        assert_eq!(at(691_234.25, 2.0), Some([691_235.0, 0.0, 0.0]));
        assert_eq!(at(-691_234.25, 2.0), Some([-691_233.0, 0.0, 0.0]));
        let small = at(500.123, 0.001).map(|origin| origin[0] * 1024.0);
        assert!(small.is_some_and(|x| x.fract() == 0.0), "{small:?}");
        assert_eq!(at(1e6, 0.0), None, "no extent");
        assert_eq!(own_origin(&[]), None);
        assert_eq!(own_origin(&[[f64::MAX; 3], [-f64::MAX; 3]]), None);
    }

    #[test]
    fn moving_there_and_back_loses_nothing() {
        let points = [[691_234.123_456_789, 5_334_987.987_654_321, 512.1], [691_235.5, 5_334_988.25, 513.7]];
        let origin = own_origin(&points);
        assert!(origin.is_some());
        let mut moved = points;
        move_to(origin, &mut moved);
        assert!(moved.as_flattened().iter().all(|x| x.abs() < 2.0));
        move_from(origin, &mut moved);
        assert_eq!(moved, points);
    }
}
