//! Matches of points with normals, by both.

use cager_geometry::vector::Point;
use glam::DVec3;

use super::nearest::NearestPoints;

/// Oriented points in a tree over positions and scaled normals. The nearest is near in space and
/// faces the same way, so that a finger does not match the back of its neighbour.
pub struct OrientedPoints {
    tree: NearestPoints<6>,
    normal_length: f64,
}

impl OrientedPoints {
    /// Points and their unit normals; a normal counts as much as a distance of `normal_length`.
    ///
    /// # Panics
    /// Without any point.
    pub fn new<P: Copy + Into<Point>>(points: &[P], normals: &[P], normal_length: f64) -> Self {
        let joined = points.iter().zip(normals).map(|(&p, &n)| join(p, n, normal_length));
        Self { tree: NearestPoints::new(joined), normal_length }
    }

    /// The number of the nearest point, and the squared distance in six dimensions.
    pub fn nearest<P: Into<Point>>(&self, point: P, normal: P) -> (usize, f64) {
        self.tree.nearest(join(point, normal, self.normal_length))
    }

    /// [`Self::nearest`], no farther than the one that was it before, if any; it is remembered.
    pub(crate) fn nearest_again(&self, point: DVec3, normal: DVec3, known: &mut Option<u32>) -> (usize, f64) {
        let joined = join(point, normal, self.normal_length);
        let found = match *known {
            Some(known) => self.tree.nearest_from(joined, known as usize),
            None => self.tree.nearest(joined),
        };
        *known = Some(found.0 as u32);
        found
    }
}

/// The last matches of a template with a surface, near which the next ones are.
pub struct KnownMatches {
    /// The observed point of each sample.
    pub(crate) there: Vec<Option<u32>>,
    /// The sample of each observed point.
    pub(crate) back: Vec<Option<u32>>,
}

impl KnownMatches {
    /// None yet.
    pub(crate) fn none(samples: usize, points: usize) -> Self {
        Self { there: vec![None; samples], back: vec![None; points] }
    }

    /// Forgets them where they are of other numbers of samples and observed points.
    pub(crate) fn keep_if_of(&mut self, samples: usize, points: usize) {
        if (self.there.len(), self.back.len()) != (samples, points) {
            *self = Self::none(samples, points);
        }
    }
}

/// A point with its normal in six dimensions.
pub(crate) fn join<P: Into<Point>>(point: P, normal: P, normal_length: f64) -> [f64; 6] {
    let ([x, y, z], [a, b, c]) = (point.into(), normal.into().map(|x| normal_length * x));
    [x, y, z, a, b, c]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn matches_with_a_surface_of_other_points_are_forgotten() {
        let mut known = KnownMatches { there: vec![Some(7); 2], back: vec![Some(1); 9] };
        known.keep_if_of(2, 9);
        assert_eq!((&known.there, &known.back), (&vec![Some(7); 2], &vec![Some(1); 9]));
        known.keep_if_of(2, 5);
        assert_eq!((known.there, known.back), (vec![None; 2], vec![None; 5]));
    }
}
