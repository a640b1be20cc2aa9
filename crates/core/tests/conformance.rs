//! What every coordinate system must satisfy, on cages that are convex, coplanar, concave, detailed and thin.
//!
//! The bar: affine reproduction within 1e-10 of the diagonal and rows that sum to one, for points inside, outside, on
//! faces, edges and vertices and at 1e-12…1e-4 of them, for cages scaled by 1e-6…1e6. What not every system promises is a
//! parameter of the suite.

mod common;

use cager_core::cage::Cage;
use cager_core::coordinates::{CoordinateSystem, Coordinates, CoordinatesError, Green, Harmonic, MeanValue};
use cager_geometry::mesh::{Point, diagonal, distance_to_surface, winding_number};
use cager_geometry::vector::{along, combination, cross, mean, norm, sub};
use common::{Random, cages, cages_of, thin_cages};
use faer::Mat;

#[test]
fn mean_value_coordinates_conform() {
    suite(
        &MeanValue,
        Promises {
            defined_outside: true,
            in_thin_cages: true,
            barycentric_on_faces: true,
            continuous_outside: true,
            order: 1e-7,
            stride: 1,
            detail: 120,
            exponents: &[-6, 6],
        },
    );
}

#[test]
fn green_coordinates_conform() {
    // Both of them have the same Φ.
    suite(
        &Green::Free,
        Promises {
            defined_outside: true,
            in_thin_cages: true,
            barycentric_on_faces: false,
            continuous_outside: false,
            order: 1e-7,
            stride: 1,
            detail: 120,
            exponents: &[-6, 6],
        },
    );
}

#[test]
fn harmonic_coordinates_conform() {
    suite(
        &Harmonic,
        Promises {
            defined_outside: false,
            in_thin_cages: false,
            barycentric_on_faces: true,
            continuous_outside: false,
            // Densities meet the points in single precision, and in the order of the elements: up to 4e-7 was seen.
            order: 1e-5,
            stride: 9,
            detail: 32,
            // Thin cages are scaled by both.
            exponents: &[-6],
        },
    );
}

#[test]
fn coordinates_reproduce_points_far_outside() {
    for system in [&MeanValue as &dyn CoordinateSystem, &Green::Free] {
        for (name, cage) in cages() {
            reproduces_points_far_outside(system, name, &cage, &[10.0, 1e3, 1e5]);
        }
    }
    for (name, cage) in thin_cages() {
        reproduces_points_far_outside(&MeanValue, name, &cage, &[10.0]);
        reproduces_points_far_outside(&Green::Free, name, &cage, &[10.0, 1e3, 1e5]);
    }
}

fn reproduces_points_far_outside(system: &dyn CoordinateSystem, name: &str, cage: &Cage, distances: &[f64]) {
    let mut random = Random::new(17);
    for &distance in distances {
        let points: Vec<Point> = (0..10).map(|_| random.direction().map(|c| c * distance)).collect();
        let found = system.coordinates(cage, &points, None).unwrap();
        let unknowns = system.values(cage).rest;
        assert_eq!(found.outside.len(), points.len(), "{name}: not all points at {distance:e} are outside");
        for (i, p) in points.iter().enumerate() {
            let name = format!("{name} from {distance:e}");
            assert_reproduced(&name, &row(&found.phi, i), cage.vertices().len(), &unknowns, *p, distance);
        }
    }
}

fn row(phi: &Mat<f64>, i: usize) -> Vec<f64> {
    (0..phi.ncols()).map(|j| phi[(i, j)]).collect()
}

/// Affine reproduction and the sum of a row, up to the rounding of its own entries, which are large outside thin cages.
fn assert_reproduced(name: &str, row: &[f64], vertices: usize, unknowns: &[Point], p: Point, size: f64) {
    assert!(row.iter().all(|x| x.is_finite()), "{name}: point {p:?} has a NaN");
    let largest = row.iter().fold(1.0, |a: f64, w| a.max(w.abs()));
    let sum: f64 = row[..vertices].iter().sum();
    assert!((sum - 1.0).abs() < 1e-12 * largest, "{name}: the row of {p:?} sums to {sum}");
    for c in 0..3 {
        let error = (row.iter().zip(unknowns).map(|(w, v)| w * v[c]).sum::<f64>() - p[c]).abs() / size;
        assert!(error <= 1e-10, "{name}: point {p:?} is off by {error:e}");
    }
}

/// What some systems promise and others do not.
#[derive(Clone, Copy)]
struct Promises {
    /// Coordinates exist outside the cage as well as inside and on it.
    defined_outside: bool,
    /// Coordinates can be computed in cages of any thickness, not only in those up to some tens of times wider than thick.
    in_thin_cages: bool,
    /// On a face, coordinates are the barycentric ones of its corners. Green coordinates interpolate no cage that is not similar
    /// to the one at rest.
    barycentric_on_faces: bool,
    /// Coordinates are continuous outside the cage as well as inside.
    continuous_outside: bool,
    /// How far a coordinate may differ when vertices and faces come in another order.
    order: f64,
    /// Every so many points are enough to see that scale, order and rigid motions do not matter: what is solved numerically takes seconds
    /// each time, and more for more points.
    stride: usize,
    /// Vertices of the most detailed cage.
    detail: usize,
    /// Powers of ten by which cages are scaled.
    exponents: &'static [i32],
}

fn suite(system: &dyn CoordinateSystem, promises: Promises) {
    for (name, cage) in thin_cages() {
        if !promises.in_thin_cages {
            conforms_or_refuses(system, promises, name, &cage);
            continue;
        }
        reproduces_affine_functions_at_any_scale(system, promises, name, &cage);
        does_not_depend_on_the_order_of_vertices_and_faces(system, promises, name, &cage);
        let (probes, on_faces) = (probes(promises, &cage), points_on_faces(&cage));
        let [probes, on_faces] = solved(system, &cage, [probes, on_faces]);
        reproduces_affine_functions(system, name, &cage, &probes);
        if promises.barycentric_on_faces {
            is_barycentric_on_faces(name, &cage, &on_faces);
        }
    }
    for (name, cage) in cages_of(promises.detail) {
        reproduces_affine_functions_at_any_scale(system, promises, name, &cage);
        does_not_depend_on_the_order_of_vertices_and_faces(system, promises, name, &cage);
        follows_rigid_motions(system, promises, name, &cage);
        let (at_cage, across) = (places_at_the_cage(promises, &cage), places_in_planes(promises, &cage));
        // Together: of all these points at once, a numerical solution is computed once.
        let points = [probes(promises, &cage), points_on_faces(&cage), at_cage.concat(), across.concat()];
        let [probes, on_faces, beside, in_planes] = solved(system, &cage, points);
        reproduces_affine_functions(system, name, &cage, &probes);
        if promises.barycentric_on_faces {
            is_barycentric_on_faces(name, &cage, &on_faces);
        }
        is_continuous_at_the_cage(name, &at_cage, &beside);
        is_continuous_across_planes_of_far_faces(promises, name, &across, &in_planes);
    }
}

/// Points with their rows of `Φ`, and which of them are outside.
struct Solved {
    points: Vec<Point>,
    phi: Mat<f64>,
    outside: Vec<u32>,
}

/// Coordinates of several sets of points, computed together.
fn solved<const N: usize>(system: &dyn CoordinateSystem, cage: &Cage, sets: [Vec<Point>; N]) -> [Solved; N] {
    let Coordinates { phi, outside, .. } = system.coordinates(cage, &sets.concat(), None).unwrap();
    let mut first = 0;
    sets.map(|points| {
        let here = first..first + points.len();
        first = here.end;
        let inside = outside.iter().filter(|&&i| here.contains(&(i as usize)));
        Solved {
            phi: phi.get(here.clone(), ..).to_owned(),
            outside: inside.map(|i| i - here.start as u32).collect(),
            points,
        }
    })
}

/// Those points at which the system promises coordinates. Points within 1e-9 of the cage lie on it.
fn defined(promises: Promises, cage: &Cage, mut points: Vec<Point>) -> Vec<Point> {
    let (vertices, triangles) = (cage.vertices(), &cage.mesh().triangles);
    let on = |x: Point| distance_to_surface(vertices, triangles, x) < 0.99e-9 * cage.diagonal();
    points.retain(|&x| promises.defined_outside || on(x) || winding_number(vertices, triangles, x) > 0.5);
    points
}

/// Of a thin cage, what is promised of others, or a sentence that says what to do.
fn conforms_or_refuses(system: &dyn CoordinateSystem, promises: Promises, name: &str, cage: &Cage) {
    let points = some(promises, probes(promises, cage));
    // The blade takes as long as all others.
    let scales: &[f64] = if name == "blade" { &[1e6] } else { &[1e-6, 1e6] };
    let outcome = |&scale: &f64| {
        let cage = common::mapped(cage, |p| p.map(|c| c * scale));
        let scaled: Vec<Point> = points.iter().map(|p| p.map(|c| c * scale)).collect();
        let all = [&scaled[..], &points_on_faces(&cage)].concat();
        match system.coordinates(&cage, &all, None) {
            Ok(found) => {
                let rows = |from: usize, points: &[Point]| Solved {
                    points: points.to_vec(),
                    phi: found.phi.get(from..from + points.len(), ..).to_owned(),
                    outside: Vec::new(),
                };
                let (probes, on_faces) = all.split_at(scaled.len());
                reproduces_affine_functions(system, name, &cage, &rows(0, probes));
                is_barycentric_on_faces(name, &cage, &rows(probes.len(), on_faces));
                true
            }
            Err(error @ CoordinatesError::NotComputed { .. }) => {
                let text = error.to_string();
                assert!(text.contains(system.name()) && text.contains("use mean value coordinates"), "{name}: {text}");
                false
            }
            Err(error) => panic!("{name}: {error}"),
        }
    };
    let outcomes: Vec<bool> = scales.iter().map(outcome).collect();
    assert!(outcomes.iter().all(|&done| done == outcomes[0]), "{name}: scaling changes what is computed");
}

/// As many of the points as a system needs.
fn some(promises: Promises, points: Vec<Point>) -> Vec<Point> {
    points.into_iter().step_by(promises.stride).collect()
}

/// Points with a distance to some part of the cage that goes down to zero, and points anywhere.
fn probes(promises: Promises, cage: &Cage) -> Vec<Point> {
    let random = &mut Random::new(7);
    let vertices = cage.vertices();
    let size = cage.diagonal();
    let mut points = Vec::new();
    for _ in 0..300 {
        points.push([0, 1, 2].map(|_| size * (random.uniform() - 0.5) * 1.5));
    }
    let faces = &cage.mesh().triangles;
    for k in 0..400 {
        let face = faces[(random.uniform() * faces.len() as f64) as usize % faces.len()].map(|v| vertices[v as usize]);
        let mut weights = [random.uniform(), random.uniform(), random.uniform()];
        for w in weights.iter_mut().take(k % 3) {
            *w = 0.0;
        }
        let total: f64 = weights.iter().sum();
        let on = combination(weights.map(|w| w / total), face);
        points.push(on);
        for exponent in [-12, -11, -10, -8, -6, -4] {
            let direction = random.direction();
            let distance = size * 10f64.powi(exponent);
            points.push(along(on, distance, direction));
        }
    }
    points.extend_from_slice(vertices);
    defined(promises, cage, points)
}

fn reproduces_affine_functions(system: &dyn CoordinateSystem, name: &str, cage: &Cage, found: &Solved) {
    let (unknowns, size) = (system.values(cage).rest, diagonal(&found.points));
    for (i, p) in found.points.iter().enumerate() {
        assert_reproduced(name, &row(&found.phi, i), cage.vertices().len(), &unknowns, *p, size);
    }
}

fn reproduces_affine_functions_at_any_scale(
    system: &dyn CoordinateSystem,
    promises: Promises,
    name: &str,
    cage: &Cage,
) {
    let points = some(promises, probes(promises, cage));
    for &exponent in promises.exponents {
        let scale = 10f64.powi(exponent);
        let scaled = common::mapped(cage, |p| p.map(|c| c * scale));
        let points = points.iter().map(|p| p.map(|c| c * scale)).collect();
        let [found] = solved(system, &scaled, [points]);
        reproduces_affine_functions(system, &format!("{name} × {scale:e}"), &scaled, &found);
    }
}

fn does_not_depend_on_the_order_of_vertices_and_faces(
    system: &dyn CoordinateSystem,
    promises: Promises,
    name: &str,
    cage: &Cage,
) {
    let points = some(promises, probes(promises, cage));
    let found = system.coordinates(cage, &points, None).unwrap();
    let (shuffled, order) = common::shuffled(cage, &mut Random::new(11));
    let other = system.coordinates(&shuffled, &points, None).unwrap();
    // Points within rounding of an edge may be taken for points on it in one order and not in the other.
    let vertices = cage.vertices();
    for i in 0..points.len() {
        for (new, &old) in order.iter().enumerate() {
            let difference = (found.phi[(i, old)] - other.phi[(i, new)]).abs();
            assert!(
                difference < promises.order,
                "{name}: point {i} {:?} vertex {old} {:?} differs by {difference:e}",
                points[i],
                vertices[old]
            );
        }
    }
}

fn follows_rigid_motions(system: &dyn CoordinateSystem, promises: Promises, name: &str, cage: &Cage) {
    let mut random = Random::new(13);
    let points = (0..200).map(|_| [0, 1, 2].map(|_| cage.diagonal() * (random.uniform() - 0.5))).collect();
    let points = some(promises, defined(promises, cage, points));
    let found = system.coordinates(cage, &points, None).unwrap();
    let motion = |p: Point| {
        let (s, c) = 0.7f64.sin_cos();
        let q = [c * p[0] - s * p[1], s * p[0] + c * p[1], p[2]];
        let (s, c) = 1.1f64.sin_cos();
        [q[0] + 3.0, c * q[1] - s * q[2] - 2.0, s * q[1] + c * q[2] + 1.0]
    };
    let moved: Vec<Point> = points.iter().map(|&p| motion(p)).collect();
    let other = system.coordinates(&common::mapped(cage, motion), &moved, None).unwrap();
    for i in 0..points.len() {
        for j in 0..found.phi.ncols() {
            let difference = (found.phi[(i, j)] - other.phi[(i, j)]).abs();
            assert!(difference < 1e-8, "{name}: point {i} changes by {difference:e} under a rigid motion");
        }
    }
    assert_eq!(found.outside, other.outside, "{name}: what is outside changes under a rigid motion");
}

const WEIGHTS: [f64; 3] = [0.2, 0.3, 0.5];

/// A point on each face.
fn points_on_faces(cage: &Cage) -> Vec<Point> {
    let on = |corners: [Point; 3]| combination(WEIGHTS, corners);
    cage.faces().iter().map(|face| on(face.vertices.map(|v| cage.vertices()[v as usize]))).collect()
}

fn is_barycentric_on_faces(name: &str, cage: &Cage, Solved { phi, .. }: &Solved) {
    for (f, face) in cage.faces().iter().enumerate() {
        for j in 0..cage.vertices().len() {
            let expected = face.vertices.iter().position(|&v| v as usize == j).map_or(0.0, |i| WEIGHTS[i]);
            assert!(
                (phi[(f, j)] - expected).abs() < 1e-9,
                "{name}: {} at vertex {j} of face {:?}, not {expected}",
                phi[(f, j)],
                face.vertices
            );
        }
    }
}

/// Places on the cage, each with points beside it.
fn places_at_the_cage(promises: Promises, cage: &Cage) -> Vec<Vec<Point>> {
    let mut random = Random::new(19);
    let vertices = cage.vertices();
    let mut places: Vec<Vec<Point>> = Vec::new();
    for face in cage.faces() {
        let [a, b, c] = face.vertices.map(|v| vertices[v as usize]);
        for weights in [[0.2, 0.3, 0.5], [0.6, 0.4, 0.0], [0.0, 0.1, 0.9], [1.0, 0.0, 0.0]] {
            let on = combination(weights, [a, b, c]);
            let mut points: Vec<Point> = vec![on];
            for distance in [1e-15, 1e-13, 1e-12, 1e-11, 1e-9, 1e-8] {
                for _ in 0..4 {
                    let direction = random.direction();
                    points.push(along(on, distance * cage.diagonal(), direction));
                }
            }
            places.push(defined(promises, cage, points));
        }
    }
    places
}

fn is_continuous_at_the_cage(name: &str, places: &[Vec<Point>], Solved { phi, .. }: &Solved) {
    let mut first = 0;
    for points in places {
        for i in 1..points.len() {
            for j in 0..phi.ncols() {
                let jump = (phi[(first + i, j)] - phi[(first, j)]).abs();
                assert!(jump < 1e-5, "{name}: column {j} jumps by {jump:e} from {:?} to {:?}", points[0], points[i]);
            }
        }
        first += points.len();
    }
}

/// Places in the plane of a face, each with points above and below.
fn places_in_planes(promises: Promises, cage: &Cage) -> Vec<Vec<Point>> {
    let mut places: Vec<Vec<Point>> = Vec::new();
    for face in cage.faces().iter().take(60) {
        let [a, b, c] = face.vertices.map(|v| cage.vertices()[v as usize]);
        let (e, f) = (sub(b, a), sub(c, a));
        let n = cross(e, f);
        let normal = n.map(|x| x / norm(n));
        for (s, t) in [(1.7, 0.4), (-0.6, 0.9), (0.3, -1.1), (2.3, 2.1), (-1.3, -0.2)] {
            let on: Point = along(along(a, s, e), t, f);
            let beside = [1e-16, -1e-14, 1e-12, 1e-10, 1e-9].map(|h| along(on, h * cage.diagonal(), normal));
            let points = defined(promises, cage, std::iter::once(on).chain(beside).collect());
            if !points.is_empty() {
                places.push(points);
            }
        }
    }
    places
}

fn is_continuous_across_planes_of_far_faces(promises: Promises, name: &str, places: &[Vec<Point>], found: &Solved) {
    let Solved { phi, outside, .. } = found;
    let mut first = 0;
    for points in places {
        let here = first..first + points.len();
        first = here.end;
        if !promises.continuous_outside && outside.iter().any(|&i| here.contains(&(i as usize))) {
            continue;
        }
        for i in 1..points.len() {
            for j in 0..phi.ncols() {
                let jump = (phi[(here.start + i, j)] - phi[(here.start, j)]).abs();
                assert!(jump < 1e-6, "{name}: column {j} jumps by {jump:e} from {:?} to {:?}", points[0], points[i]);
            }
        }
    }
}

#[test]
fn harmonic_coordinates_do_not_exist_outside() {
    for (name, cage) in cages().into_iter().chain(thin_cages()) {
        let inside = mean(cage.vertices());
        let out = along(inside, 1.25, sub(cage.vertices()[0], inside));
        let far = [9.0 * cage.diagonal(), 0.0, 0.0];
        let (vertices, triangles) = (cage.vertices(), &cage.mesh().triangles);
        let expected: Vec<u32> = [inside, out, inside, far]
            .iter()
            .enumerate()
            .filter(|(_, p)| winding_number(vertices, triangles, **p) < 0.5)
            .map(|(i, _)| i as u32)
            .collect();
        let error = Harmonic.coordinates(&cage, &[inside, out, inside, far], None).unwrap_err();
        let CoordinatesError::Outside { system, points, distance } = error else { panic!("{name}: {error}") };
        assert_eq!((system, points), ("harmonic", expected), "{name}");
        let farthest = distance_to_surface(vertices, triangles, far) / cage.diagonal();
        assert!((distance - farthest).abs() < 1e-9 * farthest, "{name}: {distance} for {farthest}");
    }
}
