//! Normals of corners, computed anew where a surface was deformed.

use super::tilts::{Tilts, angles, leaning};
use super::{Part, Subdivision};
use crate::mesh::{Point, Polygons};
use glam::{DVec3, Vec3};
use serde::{Deserialize, Serialize};
use std::collections::HashMap;

/// How much a face counts for the normals of its corners: programs differ.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Weights {
    /// By its angle at the corner (Thürmer and Wüthrich 1998).
    #[default]
    Angle,
    /// By its area.
    Area,
    /// As much as any other.
    Equal,
}

impl Weights {
    /// Whether files need not say it.
    pub fn is_usual(&self) -> bool {
        *self == Self::default()
    }
}

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

/// Which corners share a normal, and how normals are tilted: see [`Part::normals`] and [`Part::tilts`].
#[derive(Clone, Debug)]
pub struct SharedNormals {
    faces: Polygons,
    /// The normal of each corner.
    pub corners: Vec<u32>,
    /// How many normals there are.
    pub count: usize,
    /// The first corner of each.
    firsts: Vec<usize>,
    /// The angles of each; empty where none is tilted.
    tilts: Vec<[f32; 2]>,
    weights: Weights,
}

impl SharedNormals {
    /// Of faces and the numbers of their corners.
    pub fn new(faces: Polygons, given: &[u32]) -> Self {
        let (corners, firsts) = numbered(&faces, given);
        Self { faces, corners, count: firsts.len(), firsts, tilts: Vec::new(), weights: Weights::default() }
    }

    /// Those of a part that has some, whose faces count its own points.
    pub fn of(part: &Part, faces: Polygons) -> Self {
        let shared = Self::new(faces, &part.normals);
        let tilts = part.tilts.iter().flat_map(|tilts| shared.firsts.iter().map(|&corner| tilts.corners[corner]));
        let tilts = tilts.collect();
        Self { tilts, weights: part.weights, ..shared }
    }

    /// The unit normals where points are, of the faces around as these count, and tilted from there; zero where no face
    /// has an area.
    pub fn at(&self, point: impl Fn(u32) -> Point) -> Vec<Point> {
        let mut found = self.upright(point, self.weights);
        for ([normal, edge], &angles) in found.iter_mut().zip(&self.tilts) {
            *normal = leaning(*normal, *edge, angles);
        }
        found.into_iter().map(|[normal, _]| normal.to_array()).collect()
    }

    /// How the faces around count for the normals of a file, one for each corner, where points are, so that the fewest
    /// are tilted, and how these are.
    fn tilts(&self, point: impl Fn(u32) -> Point, given: &[[f32; 3]]) -> (Weights, Option<Tilts>) {
        let mut sums = vec![DVec3::ZERO; self.count];
        for (&number, &vector) in self.corners.iter().zip(given) {
            sums[number as usize] += Vec3::from(vector).normalize_or_zero().as_dvec3();
        }
        let mut fewest: (usize, Weights, Vec<_>) = (usize::MAX, Weights::default(), Vec::new());
        for weights in [Weights::Angle, Weights::Area, Weights::Equal] {
            let found = self.upright(&point, weights).into_iter().zip(&sums);
            let tilts: Vec<_> =
                found.map(|([normal, edge], sum)| angles(normal, edge, sum.normalize_or_zero())).collect();
            let count = tilts.iter().flatten().count();
            if count < fewest.0 {
                fewest = (count, weights, tilts);
            }
            if count == 0 {
                break;
            }
        }
        let (count, weights, tilts) = fewest;
        let of_corner = |&number: &u32| tilts[number as usize].unwrap_or_default();
        (weights, (count > 0).then(|| Tilts { corners: self.corners.iter().map(of_corner).collect() }))
    }

    /// The normals of the faces around, and from the point of each the edge to the next corner of the first face that has
    /// it.
    fn upright(&self, point: impl Fn(u32) -> Point, weights: Weights) -> Vec<[DVec3; 2]> {
        let mut found = vec![[DVec3::ZERO; 2]; self.count];
        let mut begin = 0;
        for face in self.faces.iter() {
            let places: Vec<DVec3> = face.iter().map(|&p| point(p).into()).collect();
            let count = places.len();
            // Newell's normal, of polygons that are not flat too.
            let center = places.iter().sum::<DVec3>() / count as f64;
            let area = |k: usize| (places[k] - center).cross(places[(k + 1) % count] - center);
            let area = (0..count).map(area).sum::<DVec3>();
            let normal = area.normalize_or_zero();
            for k in 0..count {
                let [before, after] = [(k + count - 1) % count, (k + 1) % count].map(|j| places[j] - places[k]);
                let number = self.corners[begin + k] as usize;
                found[number][0] += match weights {
                    Weights::Angle => normal * before.cross(after).length().atan2(before.dot(after)),
                    Weights::Area => area,
                    Weights::Equal => normal,
                };
                if self.firsts[number] == begin + k {
                    found[number][1] = after;
                }
            }
            begin += count;
        }
        found.iter_mut().for_each(|[sum, _]| *sum = sum.normalize_or_zero());
        found
    }
}

impl Part {
    /// Takes the normals that a file has at the corners of its faces, where its points are at rest. Faces count its own
    /// points. Of a subdivision surface they say nothing but which edges are hard.
    pub fn take_normals(&mut self, faces: &Polygons, point: impl Fn(u32) -> Point, normals: &[[f32; 3]]) {
        self.normals = sharing(faces.indices(), normals);
        self.take_tilts(faces, point, normals);
    }

    /// The tilts and weights alone, where it is known already which corners share a normal.
    pub fn take_tilts(&mut self, faces: &Polygons, point: impl Fn(u32) -> Point, normals: &[[f32; 3]]) {
        if self.subdivision == Subdivision::None {
            (self.weights, self.tilts) = SharedNormals::new(faces.clone(), &self.normals).tilts(point, normals);
        }
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

    /// A strip of two faces, bent along its middle, and points that are turned, moved and bent further.
    fn strip() -> (Polygons, [Point; 6], [Point; 6]) {
        let mut faces = Polygons::new();
        faces.push(&[0, 1, 2, 3]);
        faces.push(&[3, 2, 4, 5]);
        let bent = |angle: f64| {
            let [x, y] = [1.0 + angle.cos(), angle.sin()];
            [[0.0, 0.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 1.0], [1.0, 0.0, 0.0], [x, y, 1.0], [x, y, 0.0]]
        };
        let turned = bent(0.8).map(|[x, y, z]| [3.0 * z + 7.0, 3.0 * x, 3.0 * y]);
        (faces, bent(0.3), turned)
    }

    #[test]
    fn tilted_normals_keep_their_angle_to_the_surface() {
        let (faces, rest, deformed) = strip();
        let at = |points: [Point; 6]| move |point: u32| points[point as usize];
        // All lean towards z, which the second shape has as x.
        let smooth = SharedNormals::new(faces.clone(), &[0; 8]);
        let leant = |normals: Vec<Point>, toward: DVec3| -> Vec<DVec3> {
            normals.into_iter().map(|normal| (DVec3::from(normal) + 0.4 * toward).normalize()).collect()
        };
        let given = leant(smooth.at(at(rest)), DVec3::Z);
        let by_corner: Vec<[f32; 3]> =
            smooth.corners.iter().map(|&k| (2.0 * given[k as usize]).as_vec3().to_array()).collect();
        let mut part = Part { points: 6, faces: 2, ..Part::default() };
        part.take_normals(&faces, at(rest), &by_corner);
        assert_eq!(part.tilts.as_ref().map(|tilts| tilts.corners.len()), Some(8));
        let tilted = SharedNormals::of(&part, faces.clone());
        let close = |found: Vec<Point>, wanted: &[DVec3], least: f64| {
            found.iter().zip(wanted).all(|(&a, &b)| DVec3::from(a).dot(b) > least)
        };
        assert!(close(tilted.at(at(rest)), &given, 1.0 - 1e-6));
        let wanted = leant(smooth.at(at(deformed)), DVec3::X);
        assert!(close(tilted.at(at(deformed)), &wanted, 5_f64.to_radians().cos()));
        assert!(!close(smooth.at(at(deformed)), &wanted, 20_f64.to_radians().cos()));
        // What the faces say, and what is to be subdivided, has none.
        let plain: Vec<[f32; 3]> =
            smooth.corners.iter().map(|&k| smooth.at(at(rest))[k as usize].map(|x| x as f32)).collect();
        part.take_normals(&faces, at(rest), &plain);
        assert_eq!(part.tilts, None);
        part.subdivision = Subdivision::Loop;
        part.take_normals(&faces, at(rest), &by_corner);
        assert_eq!((part.tilts, part.normals.len()), (None, 8));
    }
}
