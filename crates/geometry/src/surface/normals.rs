//! Normals of corners, computed anew where a surface was deformed.

use crate::mesh::{Point, Polygons};
use glam::{DVec3, Vec3};
use std::collections::HashMap;

/// Corners of a point that have the same of these numbers as one: a new number for each corner, counted from 0 as they
/// come, and the first corner of each.
pub fn numbered(faces: &Polygons, given: &[u32]) -> (Vec<u32>, Vec<usize>) {
    let mut known: HashMap<(u32, u32), u32> = HashMap::with_capacity(given.len());
    let mut firsts = Vec::new();
    let corners = faces.indices().iter().zip(given).enumerate().map(|(corner, (&point, &number))| {
        *known.entry((point, number)).or_insert_with(|| {
            firsts.push(corner);
            firsts.len() as u32 - 1
        })
    });
    let corners = corners.collect();
    (corners, firsts)
}

/// Cosine of the angle within which normals of a point are one: rounding and averages of programs
/// are within it, and nobody sees such an edge.
const ONE: f32 = 0.9994;
/// Normals of a point that are compared.
const MOST_OF_POINT: usize = 64;

/// Which corners share a normal ([`Part::normals`](super::Part::normals)), by the point of each and
/// the normal that a file gives it, of any length.
pub fn sharing(points: &[u32], normals: &[[f32; 3]]) -> Vec<u32> {
    let mut known: HashMap<u32, Vec<(Vec3, u32)>> = HashMap::with_capacity(points.len());
    let mut count = 0;
    let number = |(&point, &normal): (&u32, &[f32; 3])| {
        let normal = Vec3::from(normal).normalize_or_zero();
        let of_point = known.entry(point).or_default();
        // Of more than a mesh has at a point, each is one of its own.
        let same = of_point.iter().take(MOST_OF_POINT).find(|(other, _)| *other == normal || other.dot(normal) > ONE);
        same.map(|&(_, number)| number).unwrap_or_else(|| {
            of_point.push((normal, count));
            count += 1;
            count - 1
        })
    };
    points.iter().zip(normals).map(number).collect()
}

/// Which corners share a normal: see [`Part::normals`](super::Part::normals).
#[derive(Clone, Debug)]
pub struct SharedNormals {
    faces: Polygons,
    /// The normal of each corner.
    pub corners: Vec<u32>,
    /// How many normals there are.
    pub count: usize,
}

impl SharedNormals {
    /// Of faces and the numbers of their corners.
    pub fn new(faces: Polygons, given: &[u32]) -> Self {
        let (corners, firsts) = numbered(&faces, given);
        Self { faces, corners, count: firsts.len() }
    }

    /// The unit normals where points are, faces weighted by their angles (Thürmer and Wüthrich 1998); zero where no face
    /// has an area.
    pub fn at(&self, point: impl Fn(u32) -> Point) -> Vec<Point> {
        let mut sums = vec![DVec3::ZERO; self.count];
        let mut begin = 0;
        for face in self.faces.iter() {
            let places: Vec<DVec3> = face.iter().map(|&p| point(p).into()).collect();
            let count = places.len();
            // Newell's normal, of polygons that are not flat too.
            let center = places.iter().sum::<DVec3>() / count as f64;
            let area = |k: usize| (places[k] - center).cross(places[(k + 1) % count] - center);
            let normal = (0..count).map(area).sum::<DVec3>().normalize_or_zero();
            for k in 0..count {
                let [before, after] = [(k + count - 1) % count, (k + 1) % count].map(|j| places[j] - places[k]);
                let angle = before.cross(after).length().atan2(before.dot(after));
                sums[self.corners[begin + k] as usize] += normal * angle;
            }
            begin += count;
        }
        sums.into_iter().map(|sum| sum.normalize_or_zero().to_array()).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn normals_of_a_point_that_differ_by_rounding_alone_are_shared() {
        let turned = |degrees: f32| [degrees.to_radians().sin(), 0.0, 2.0 * degrees.to_radians().cos()];
        let normals = [turned(0.0), turned(1.0), turned(30.0), turned(0.0), [0.0; 3], [0.0; 3]];
        assert_eq!(sharing(&[7, 7, 7, 8, 7, 7], &normals), [0, 0, 1, 2, 3, 3]);
    }

    #[test]
    fn an_edge_is_hard_where_its_corners_do_not_share() {
        let mut faces = Polygons::new();
        faces.push(&[0, 1, 2, 3]);
        faces.push(&[0, 3, 4]);
        let points = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        let at = |point: u32| points[point as usize];
        let smooth = SharedNormals::new(faces.clone(), &[0; 7]);
        assert_eq!((smooth.count, smooth.corners.clone()), (5, vec![0, 1, 2, 3, 0, 3, 4]));
        let normals = smooth.at(at);
        assert_eq!(normals[1], [0.0, 0.0, 1.0]);
        assert!((normals[0][2] - 0.5f64.sqrt()).abs() < 1e-12 && normals[0][1] == 0.0, "{:?}", normals[0]);
        let hard = SharedNormals::new(faces, &[0, 0, 0, 0, 1, 1, 1]);
        assert_eq!(hard.count, 7);
        assert_eq!(hard.at(at)[4..], [[1.0, 0.0, 0.0]; 3]);
    }
}
