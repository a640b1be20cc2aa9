//! Cages and random numbers for the tests of this crate.
#![allow(dead_code)]

use cager_core::cage::Cage;
use cager_core::inversion::{Rows, Solver};
use cager_demo::{Capture, Options};
use cager_geometry::mesh::{Point, TriMesh};

/// For tests that want cages alone, of whole frames or of the rows of handles.
pub(crate) trait Cages {
    fn cages<T: Copy + Into<f64>>(&self, frames: &[&[T]]) -> Vec<Vec<f32>>;
    fn cages_after<T: Copy + Into<f64>>(&self, previous: Option<&[f32]>, frames: &[&[T]]) -> Vec<Vec<f32>>;
    fn cages_of_handles<T: Copy + Into<f64>>(&self, previous: Option<&[f32]>, rows: &[&[T]]) -> Vec<Vec<f32>>;
}

impl Cages for Solver {
    fn cages<T: Copy + Into<f64>>(&self, frames: &[&[T]]) -> Vec<Vec<f32>> {
        self.cages_after(None, frames)
    }

    fn cages_after<T: Copy + Into<f64>>(&self, previous: Option<&[f32]>, frames: &[&[T]]) -> Vec<Vec<f32>> {
        self.invert(Rows::All, previous, frames).into_iter().map(|inverted| inverted.cage).collect()
    }

    fn cages_of_handles<T: Copy + Into<f64>>(&self, previous: Option<&[f32]>, rows: &[&[T]]) -> Vec<Vec<f32>> {
        self.invert(Rows::Handles, previous, rows).into_iter().map(|inverted| inverted.cage).collect()
    }
}

/// A small generator with a fixed seed, so that failures repeat.
pub(crate) struct Random(u64);

impl Random {
    pub(crate) fn new(seed: u64) -> Self {
        Self(seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1)
    }

    /// In [0, 1).
    pub(crate) fn uniform(&mut self) -> f64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 11) as f64 / (1u64 << 53) as f64
    }

    pub(crate) fn direction(&mut self) -> Point {
        loop {
            let p = [0, 1, 2].map(|_| 2.0 * self.uniform() - 1.0);
            let r = p.iter().map(|x| x * x).sum::<f64>().sqrt();
            if (0.1..1.0).contains(&r) {
                return p.map(|x| x / r);
            }
        }
    }
}

pub(crate) fn cages() -> Vec<(&'static str, Cage)> {
    cages_of(120)
}

/// Cages, the detailed one of so many vertices.
pub(crate) fn cages_of(vertices: usize) -> Vec<(&'static str, Cage)> {
    let detailed = Capture::new(&Options { points: 500, frames: 1, cage_vertices: vertices }).cage;
    vec![
        (
            "box with split sides",
            cage(&prism(&[[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]], &[[0, 1, 2], [0, 2, 3]])),
        ),
        ("L-shaped prism", cage(&l_shape())),
        ("octahedron", cage(&octahedron())),
        ("needle", cage(&stretched(&octahedron(), [30.0, 0.3, 1.0]))),
        ("detailed", cage(&detailed)),
    ]
}

/// Cages a thousand and more times wider than thick, where opposite faces nearly cancel.
pub(crate) fn thin_cages() -> Vec<(&'static str, Cage)> {
    let square = || prism(&[[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]], &[[0, 1, 2], [0, 2, 3]]);
    vec![
        ("plate", cage(&stretched(&square(), [1.0, 1.0, 1e-3]))),
        ("rod", cage(&stretched(&square(), [1.0, 1e-4, 1e-4]))),
        ("flat L-shaped prism", cage(&stretched(&l_shape(), [1.0, 1.0, 1e-4]))),
        ("blade", cage(&stretched(&octahedron(), [1.0, 1e-2, 1e-4]))),
    ]
}

fn cage(mesh: &TriMesh) -> Cage {
    Cage::new(mesh.clone()).expect("a valid cage")
}

pub(crate) fn octahedron() -> TriMesh {
    TriMesh {
        vertices: vec![
            [1.0, 0.0, 0.0],
            [-1.0, 0.0, 0.0],
            [0.0, 1.0, 0.0],
            [0.0, -1.0, 0.0],
            [0.0, 0.0, 1.0],
            [0.0, 0.0, -1.0],
        ],
        triangles: vec![[0, 2, 4], [2, 1, 4], [1, 3, 4], [3, 0, 4], [2, 0, 5], [1, 2, 5], [3, 1, 5], [0, 3, 5]],
    }
}

fn l_shape() -> TriMesh {
    prism(
        &[[-1.0, -1.0], [1.0, -1.0], [1.0, -0.4], [-0.4, -0.4], [-0.4, 1.0], [-1.0, 1.0]],
        &[[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 5]],
    )
}

fn stretched(mesh: &TriMesh, factors: Point) -> TriMesh {
    let vertices = mesh.vertices.iter().map(|p| [0, 1, 2].map(|k| p[k] * factors[k])).collect();
    TriMesh { vertices, triangles: mesh.triangles.clone() }
}

/// A counter-clockwise outline with its triangulation, from z = −1 to z = 1.
fn prism(outline: &[[f64; 2]], top: &[[u32; 3]]) -> TriMesh {
    let n = outline.len() as u32;
    let mut mesh = TriMesh::default();
    for z in [-1.0, 1.0] {
        mesh.vertices.extend(outline.iter().map(|p| [p[0], p[1], z]));
    }
    for t in top {
        mesh.triangles.push([t[0], t[2], t[1]]);
        mesh.triangles.push(t.map(|v| v + n));
    }
    for i in 0..n {
        let j = (i + 1) % n;
        mesh.triangles.push([i, j, j + n]);
        mesh.triangles.push([i, j + n, i + n]);
    }
    mesh
}

pub(crate) fn mapped(cage: &Cage, f: impl Fn(Point) -> Point) -> Cage {
    let mesh = cage.mesh();
    Cage::new(TriMesh { vertices: mesh.vertices.iter().map(|&p| f(p)).collect(), triangles: mesh.triangles.clone() })
        .expect("still a cage")
}

/// The same cage with vertices and faces in another order; `order[new]` is the old index.
pub(crate) fn shuffled(cage: &Cage, random: &mut Random) -> (Cage, Vec<usize>) {
    let mut order: Vec<usize> = (0..cage.vertices().len()).collect();
    shuffle(&mut order, random);
    let mut new = vec![0u32; order.len()];
    for (k, &old) in order.iter().enumerate() {
        new[old] = k as u32;
    }
    let mut triangles: Vec<[u32; 3]> = cage.mesh().triangles.iter().map(|t| t.map(|v| new[v as usize])).collect();
    shuffle(&mut triangles, random);
    for t in &mut triangles {
        t.rotate_left((random.uniform() * 3.0) as usize % 3);
    }
    let vertices = order.iter().map(|&old| cage.vertices()[old]).collect();
    (Cage::new(TriMesh { vertices, triangles }).expect("still a cage"), order)
}

fn shuffle<T>(items: &mut [T], random: &mut Random) {
    for k in (1..items.len()).rev() {
        items.swap(k, (random.uniform() * (k + 1) as f64) as usize % (k + 1));
    }
}
