//! The derivative of mean value coordinates by the cage.

use cager_core::cage::Cage;
use cager_core::coordinates::{CoordinateSystem, MeanValue};
use cager_demo::{Capture, Options};
use cager_geometry::linalg::to_single;
use cager_geometry::mesh::{Point, TriMesh};
use faer::Mat;

mod common;

fn capture() -> Capture {
    Capture::new(&Options { points: 2_000, frames: 4, cage_vertices: 120 })
}

fn noise(rows: usize, columns: usize) -> Mat<f64> {
    let mut random = common::Random::new(7);
    Mat::from_fn(rows, columns, |_, _| 2.0 * random.uniform() - 1.0)
}

fn weighted_sum(cage: &Cage, points: &[Point], weights: &Mat<f64>) -> f64 {
    let phi = MeanValue.coordinates(cage, points, None).unwrap().phi;
    (0..phi.ncols()).map(|j| (0..phi.nrows()).map(|i| weights[(i, j)] * phi[(i, j)]).sum::<f64>()).sum()
}

#[test]
fn values_are_those_of_the_full_computation() {
    let capture = capture();
    let (cage, points) = (Cage::new(capture.cage.clone()).unwrap(), &capture.rest.points[..101]);
    let exact = MeanValue.coordinates(&cage, points, None).unwrap().phi;
    let smooth = MeanValue.smooth_coordinates(&cage, points);
    for j in 0..exact.ncols() {
        for i in 0..exact.nrows() {
            assert!((exact[(i, j)] - f64::from(smooth[(i, j)])).abs() < 1e-4, "{i} {j}");
        }
    }
}

#[test]
fn the_gradient_is_what_finite_differences_say() {
    let capture = capture();
    let cage = Cage::new(capture.cage.clone()).unwrap();
    // Not a whole number of lane groups, and one point outside.
    let mut points = capture.rest.points[..93].to_vec();
    points.push([0.9, -0.6, 0.8]);
    let weights = noise(points.len(), cage.vertices().len());
    let gradient = MeanValue.gradient(&cage, &points, to_single(weights.as_ref(), weights.nrows()).as_ref());
    let step = 3e-6 * cage.diagonal();
    let scale = gradient.iter().flatten().fold(0.0f64, |m, g| m.max(g.abs()));
    for vertex in (0..cage.vertices().len()).step_by(5) {
        for axis in 0..3 {
            let moved = |by: f64| {
                let mut mesh: TriMesh = cage.mesh().clone();
                mesh.vertices[vertex][axis] += by;
                weighted_sum(&Cage::new(mesh).unwrap(), &points, &weights)
            };
            let difference = (moved(step) - moved(-step)) / (2.0 * step);
            let error = (difference - gradient[vertex][axis]).abs();
            assert!(error < 1e-4 * scale, "{vertex} {axis}: {difference} {} {scale}", gradient[vertex][axis]);
        }
    }
}

#[test]
fn the_gradient_has_the_same_bits_for_any_number_of_threads() {
    let capture = capture();
    let (cage, points) = (Cage::new(capture.cage.clone()).unwrap(), &capture.rest.points);
    let weights = to_single(noise(points.len(), cage.vertices().len()).as_ref(), points.len());
    let with = |threads: usize| {
        rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap()
            .install(|| MeanValue.gradient(&cage, points, weights.as_ref()))
    };
    assert_eq!(with(1), with(3));
}
