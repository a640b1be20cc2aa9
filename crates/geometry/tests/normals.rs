//! Normals of files: which of the usual ways of weighting faces they follow.

use cager_geometry::mesh::{Point, Polygons};
use cager_geometry::surface::{Part, SharedNormals, Weights};
use glam::DVec3;

/// How much a face counts by its area and its angle at a point.
type Weight = fn(f64, f64) -> f64;

/// A pyramid whose sides have other areas and other angles at its top.
fn pyramid() -> (Polygons, [Point; 5]) {
    let mut faces = Polygons::new();
    for face in [&[0, 1, 4][..], &[1, 2, 4], &[2, 3, 4], &[3, 0, 4], &[3, 2, 1, 0]] {
        faces.push(face);
    }
    (faces, [[0.0, 0.0, 0.0], [4.0, 0.0, 0.0], [5.0, 1.0, 0.0], [0.0, 3.0, 0.0], [0.5, 0.4, 1.5]])
}

/// The normals of points, of faces that count as `weight` says by their area and their angle at the point.
fn weighted(faces: &Polygons, points: &[Point; 5], weight: impl Fn(f64, f64) -> f64) -> Vec<[f32; 3]> {
    let mut sums = [DVec3::ZERO; 5];
    for face in faces.iter() {
        let at = |k: usize| DVec3::from(points[face[k % face.len()] as usize]);
        let area = (1..face.len() - 1).map(|k| (at(k) - at(0)).cross(at(k + 1) - at(0))).sum::<DVec3>();
        for k in 0..face.len() {
            let [before, after] = [at(k + face.len() - 1) - at(k), at(k + 1) - at(k)];
            sums[face[k] as usize] += area.normalize() * weight(area.length(), after.angle_between(before));
        }
    }
    faces.indices().iter().map(|&point| sums[point as usize].normalize().as_vec3().to_array()).collect()
}

#[test]
fn normals_of_any_usual_weights_are_none_of_their_own() {
    let (faces, points) = pyramid();
    let ways: [(Weights, Weight); 3] =
        [(Weights::Angle, |_, angle| angle), (Weights::Area, |area, _| area), (Weights::Equal, |_, _| 1.0)];
    for (weights, weight) in ways {
        let given = weighted(&faces, &points, weight);
        let mut part = Part { points: 5, faces: 5, ..Part::default() };
        part.take_normals(&faces, |point| points[point as usize], &given);
        assert_eq!((part.weights, part.tilts.is_some()), (weights, false));
        let shared = SharedNormals::of(&part, faces.clone());
        let found = shared.at(|point| points[point as usize]);
        for (&number, given) in shared.corners.iter().zip(given) {
            let found = DVec3::from(found[number as usize]);
            assert!(found.dot(DVec3::from(given.map(f64::from))) > 1.0 - 1e-6, "{weights:?}");
        }
    }
}
