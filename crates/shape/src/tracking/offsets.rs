//! How far every vertex of a template leaves its cage to meet a surface.

use crate::points::{renamed, vectors, vertex_normals};
use crate::registration::{KnownMatches, MatchWeights, PlaneDistances, Target, conjugate_gradients, welded};
use cager_geometry::mesh::{Polygons, TriMesh};
use cager_geometry::topology::Adjacency;
use cager_geometry::vector::Point;
use glam::{DMat3, DVec3};
use rayon::prelude::*;

/// The faces of a template, for offsets that are smooth over them.
pub struct OffsetSolver {
    /// The first vertex at each one's place, which stands for all there.
    first: Vec<u32>,
    triangles: Vec<[u32; 3]>,
    adjacency: Adjacency,
    diagonal: f64,
}

/// Iterations, each with matches of its own.
const ITERATIONS: usize = 4;
/// Weight of smoothness, by sixths of a vertex's edges.
const SMOOTHNESS: f64 = 3.0 / 6.0;
/// Weight that keeps offsets small.
const SIZE: f64 = 0.02;
/// Distance at which a match counts a quarter, over the diagonal, in the first and last iteration.
const REACH: [f64; 2] = [0.02, 0.008];
/// Surfaces that face further apart than this cosine do not match.
const MIN_COSINE: f64 = 0.3;
/// Steps of conjugate gradients, at the most, and where they end.
const MAX_STEPS: usize = 30;
const TOLERANCE: f64 = 1e-5;

impl OffsetSolver {
    /// For a template at rest, with this diagonal.
    pub fn new(rest: &TriMesh, diagonal: f64) -> Self {
        let first = welded(&rest.vertices);
        let triangles = renamed(&rest.triangles, &first);
        let adjacency = Adjacency::new(&Polygons::of_triangles(&triangles), rest.vertices.len());
        Self { adjacency, first, triangles, diagonal }
    }

    /// The template's vertices moved from where their cage has them towards a surface: point to
    /// plane, both ways, smooth. Runs on the current rayon pool; the result does not depend on it.
    pub fn offset(&self, positions: &[Point], surface: &Target) -> Vec<Point> {
        let base: Vec<DVec3> = vectors(positions);
        let mut offsets = vec![DVec3::ZERO; base.len()];
        let mut known = KnownMatches::none(base.len(), surface.points.len());
        for iteration in 0..ITERATIONS {
            let t = iteration as f64 / (ITERATIONS - 1) as f64;
            let reach = REACH[0] * (REACH[1] / REACH[0]).powf(t) * self.diagonal;
            let weights = MatchWeights { total: base.len() as f64, reach, min_cosine: MIN_COSINE, every: 1, first: 0 };
            let moved: Vec<DVec3> = base.iter().zip(&offsets).map(|(&p, &d)| p + d).collect();
            let normals = vertex_normals(&moved, &self.triangles);
            let PlaneDistances { hessians, mut pulls } =
                PlaneDistances::new((&moved, &normals), surface, &weights, &mut known);
            let held = self.smoothness_times(&offsets);
            pulls.iter_mut().zip(held).for_each(|(pull, held)| *pull -= held);
            let change = self.solve(&hessians, pulls);
            offsets.iter_mut().zip(change).for_each(|(d, change)| *d += change);
        }
        base.iter().zip(&self.first).map(|(&p, &first)| (p + offsets[first as usize]).to_array()).collect()
    }

    /// What smoothness and size have against offsets: their gradient.
    fn smoothness_times(&self, x: &[DVec3]) -> Vec<DVec3> {
        (0..x.len())
            .into_par_iter()
            .with_min_len(512)
            .map(|i| {
                let differences = self.adjacency.of(i).iter().map(|&j| x[i] - x[j as usize]);
                SMOOTHNESS * differences.sum::<DVec3>() + SIZE * x[i]
            })
            .collect()
    }

    /// Conjugate gradients, each vertex's own 3 × 3 block inverted.
    fn solve(&self, hessians: &[DMat3], pulls: Vec<DVec3>) -> Vec<DVec3> {
        let inverse = |(i, &a): (usize, &DMat3)| {
            let own = SMOOTHNESS * self.adjacency.of(i).len() as f64 + SIZE;
            (a + DMat3::from_diagonal(DVec3::splat(own))).inverse()
        };
        let inverses: Vec<DMat3> = hessians.iter().enumerate().map(inverse).collect();
        let precondition = |r: &[DVec3]| r.iter().zip(&inverses).map(|(&r, &inverse)| inverse * r).collect();
        let times = |x: &[DVec3]| {
            let mut image = self.smoothness_times(x);
            image.iter_mut().zip(x).zip(hessians).for_each(|((image, &x), &a)| *image += a * x);
            image
        };
        conjugate_gradients(pulls, times, precondition, MAX_STEPS, TOLERANCE)
    }
}
