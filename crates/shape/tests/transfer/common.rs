//! Captures for tests, and errors against the truth.
#![allow(dead_code, unreachable_pub)]

use cager_cages::{EncloseOptions, enclose};
use cager_core::cage::Cage;
use cager_core::coordinates::{CoordinateSystem, MeanValue};
use cager_geometry::mesh::{Model, Point, TriMesh, diagonal};
use cager_geometry::vector::distance;
use cager_shape::Similarity;
use faer::Mat;

#[path = "../recovery/common.rs"]
mod recovery;
pub use recovery::{data, there};

/// A model of the captures.
pub fn mesh(name: &str) -> TriMesh {
    TriMesh::from(&cager_formats::read_model(&data().join(name)).unwrap())
}

/// Frames of the captures.
pub fn frames(name: &str) -> Vec<Vec<Point>> {
    let (shape, values) = recovery::npy(&data().join(name));
    let values: Vec<f64> = values.into_iter().map(f64::from).collect();
    values.chunks_exact(3 * shape[1]).map(|frame| frame.as_chunks::<3>().0.to_vec()).collect()
}

/// As a model.
pub fn model_of(mesh: &TriMesh) -> Model {
    mesh.clone().into()
}

/// A model with a cage made around it, or read, and mean value coordinates.
pub struct Caged {
    pub rest: TriMesh,
    pub cage: Cage,
    pub phi: Mat<f64>,
}

impl Caged {
    pub fn new(rest: TriMesh, vertices: usize) -> Self {
        let cage = enclose(&model_of(&rest), &EncloseOptions { vertices, ..EncloseOptions::default() }).unwrap();
        Self::within(rest, cage)
    }

    pub fn within(rest: TriMesh, cage: TriMesh) -> Self {
        let cage = Cage::new(cage).unwrap();
        let phi = MeanValue.coordinates(&cage, &rest.vertices, None).unwrap().phi;
        Self { rest, cage, phi }
    }

    pub fn source(&self) -> cager_shape::transfer::Source<'_> {
        cager_shape::transfer::Source { rest: &self.rest, cage: &self.cage, phi: self.phi.as_ref() }
    }
}

/// Mean distance of points after the best rotation and translation: how far a pose is from another one.
fn mean_error(pose: &[Point], truth: &[Point]) -> f64 {
    let best = Similarity::of_points(pose, truth, false);
    let far = |(p, q): (&Point, &Point)| distance(best.apply((*p).into()).to_array(), *q);
    pose.iter().zip(truth).map(far).sum::<f64>() / pose.len() as f64
}

/// Mean errors of some frames after rigid alignment, over those of the target not moved at all, in percent; and in percent of the diagonal.
pub fn error(found: &[Vec<Point>], truth: &[Vec<Point>], rest: &[Point], every: usize) -> [f64; 2] {
    let chosen: Vec<usize> = (0..found.len().min(truth.len())).step_by(every).collect();
    let mean = |of: &dyn Fn(usize) -> f64| chosen.iter().map(|&f| of(f)).sum::<f64>() / chosen.len() as f64;
    let own = mean(&|f| mean_error(&found[f], &truth[f]));
    let unmoved = mean(&|f| mean_error(rest, &truth[f]));
    [100.0 * own / unmoved, 100.0 * own / diagonal(rest)]
}

/// A closed body without symmetry: a sphere of so many rings, stretched, with bumps of this height.
pub fn lumpy(rings: u32, stretch: Point, height: f64) -> TriMesh {
    let around = 2 * rings;
    let mut vertices = vec![[0.0, 0.0, 1.0]];
    for i in 1..rings {
        let polar = std::f64::consts::PI * f64::from(i) / f64::from(rings);
        for j in 0..around {
            let turn = std::f64::consts::TAU * f64::from(j) / f64::from(around);
            vertices.push([polar.sin() * turn.cos(), polar.sin() * turn.sin(), polar.cos()]);
        }
    }
    vertices.push([0.0, 0.0, -1.0]);
    let bumps: [(Point, f64); 3] = [([1.0, 0.2, 0.3], 1.0), ([-0.3, 0.9, 0.6], 0.8), ([0.2, -0.5, 0.8], 1.2)];
    for p in &mut vertices {
        let bump = |(to, size): &(Point, f64)| {
            let d2: f64 = (0..3).map(|k| (p[k] - to[k]).powi(2)).sum();
            size * (-4.0 * d2).exp()
        };
        let grown = 1.0 + height * bumps.iter().map(bump).sum::<f64>();
        *p = [0, 1, 2].map(|k| stretch[k] * grown * p[k]);
    }
    let at = |i: u32, j: u32| 1 + (i - 1) * around + j % around;
    let last = vertices.len() as u32 - 1;
    let mut triangles = Vec::new();
    for j in 0..around {
        triangles.push([0, at(1, j), at(1, j + 1)]);
        triangles.push([last, at(rings - 1, j + 1), at(rings - 1, j)]);
        for i in 1..rings - 1 {
            triangles.push([at(i, j), at(i + 1, j), at(i + 1, j + 1)]);
            triangles.push([at(i, j), at(i + 1, j + 1), at(i, j + 1)]);
        }
    }
    TriMesh { vertices, triangles }
}
