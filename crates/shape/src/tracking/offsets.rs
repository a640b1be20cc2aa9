//! How far every vertex of a template leaves its cage to meet a surface.

use crate::points::{outer, plain, renamed, vectors, vertex_normals};
use crate::registration::{OrientedPoints, Target, welded};
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
/// Distance at which a match counts a quarter in the first iteration and in the last, as a share of the diagonal.
const REACH: [f64; 2] = [0.02, 0.008];
/// Surfaces that face further apart than this cosine do not match.
const MIN_COSINE: f64 = 0.3;
/// Steps of conjugate gradients, at the most, and where they end.
const MAX_STEPS: usize = 30;
const TOLERANCE: f64 = 1e-5;

/// What matches say of each vertex: `½ xᵀ A x − bᵀ x` of its displacement.
struct Pulls {
    hessians: Vec<DMat3>,
    pulls: Vec<DVec3>,
    matches: Matches,
}

/// What matched in an iteration, which is near what matches in the next one.
struct Matches {
    /// The observed point of each vertex.
    there: Vec<u32>,
    /// The vertex of each observed point.
    back: Vec<u32>,
}

impl OffsetSolver {
    /// For a template at rest, with this diagonal.
    pub fn new(rest: &TriMesh, diagonal: f64) -> Self {
        let first = welded(&rest.vertices);
        let triangles = renamed(&rest.triangles, &first);
        let adjacency = Adjacency::new(&Polygons::of_triangles(&triangles), rest.vertices.len());
        Self { adjacency, first, triangles, diagonal }
    }

    /// The template's vertices moved from `positions`, where their cage has them, towards a surface: point to plane, both ways, smooth. Runs on the
    /// current rayon pool; the result does not depend on it.
    pub fn offset(&self, positions: &[Point], surface: &Target) -> Vec<Point> {
        let base: Vec<DVec3> = vectors(positions);
        let mut offsets = vec![DVec3::ZERO; base.len()];
        let mut known = None;
        for iteration in 0..ITERATIONS {
            let t = iteration as f64 / (ITERATIONS - 1) as f64;
            let reach = REACH[0] * (REACH[1] / REACH[0]).powf(t) * self.diagonal;
            let moved: Vec<DVec3> = base.iter().zip(&offsets).map(|(&p, &d)| p + d).collect();
            let Pulls { hessians, mut pulls, matches } = self.pulls(&moved, surface, reach, known.as_ref());
            known = Some(matches);
            let held = self.smoothness_times(&offsets);
            pulls.iter_mut().zip(held).for_each(|(pull, held)| *pull -= held);
            let change = self.solve(&hessians, pulls);
            offsets.iter_mut().zip(change).for_each(|(d, change)| *d += change);
        }
        base.iter().zip(&self.first).map(|(&p, &first)| (p + offsets[first as usize]).to_array()).collect()
    }

    /// Matches of every vertex with the surface, and of every point of the surface with a vertex.
    fn pulls(&self, vertices: &[DVec3], surface: &Target, reach: f64, known: Option<&Matches>) -> Pulls {
        let normals = vertex_normals(vertices, &self.triangles);
        let term = |own: DVec3, other: DVec3, offset: DVec3, share: f64| {
            let cosine = own.dot(other);
            let far = offset.length_squared() / (reach * reach);
            let weight = if cosine > MIN_COSINE { share * cosine / (1.0 + far).powi(2) } else { 0.0 };
            let weighted = weight * other;
            let hessian = outer(weighted, other);
            (hessian, -offset.dot(other) * weighted)
        };
        let there: Vec<u32> = vertices
            .par_iter()
            .zip(&normals)
            .enumerate()
            .with_min_len(64)
            .map(|(i, (&p, &n))| match known {
                Some(known) => surface.nearest_from(p, n, known.there[i] as usize) as u32,
                None => surface.nearest(p, n) as u32,
            })
            .collect();
        let of_vertex = |(i, &j): (usize, &u32)| {
            let j = j as usize;
            term(normals[i], surface.normals()[j], vertices[i] - surface.points()[j], 1.0)
        };
        let (mut hessians, mut pulls): (Vec<DMat3>, Vec<DVec3>) = there.iter().enumerate().map(of_vertex).unzip();
        let tree = OrientedPoints::new(&plain(vertices), &plain(&normals), surface.normal_length());
        let share = vertices.len() as f64 / surface.points().len() as f64;
        let back: Vec<u32> = surface
            .points()
            .par_iter()
            .zip(surface.normals())
            .enumerate()
            .with_min_len(64)
            .map(|(k, (q, n))| match known {
                Some(known) => tree.nearest_from(q.to_array(), n.to_array(), known.back[k] as usize).0 as u32,
                None => tree.nearest(q.to_array(), n.to_array()).0 as u32,
            })
            .collect();
        for (&i, (&q, &n)) in back.iter().zip(surface.points().iter().zip(surface.normals())) {
            let i = i as usize;
            let (hessian, pull) = term(normals[i], n, vertices[i] - q, share);
            hessians[i] += hessian;
            pulls[i] += pull;
        }
        Pulls { hessians, pulls, matches: Matches { there, back } }
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

    /// Conjugate gradients from 0, each vertex's own 3 × 3 block inverted.
    fn solve(&self, hessians: &[DMat3], mut residual: Vec<DVec3>) -> Vec<DVec3> {
        let inverses: Vec<DMat3> = hessians
            .iter()
            .enumerate()
            .map(|(i, &a)| {
                let own = SMOOTHNESS * self.adjacency.of(i).len() as f64 + SIZE;
                (a + DMat3::from_diagonal(DVec3::splat(own))).inverse()
            })
            .collect();
        let scaled = |r: &[DVec3]| r.iter().zip(&inverses).map(|(&r, &inverse)| inverse * r).collect::<Vec<_>>();
        let inner = |a: &[DVec3], b: &[DVec3]| a.iter().zip(b).map(|(a, b)| a.dot(*b)).sum::<f64>();
        let mut x = vec![DVec3::ZERO; residual.len()];
        let mut direction = scaled(&residual);
        let first = inner(&residual, &direction);
        let mut size = first;
        for _ in 0..MAX_STEPS {
            let mut image = self.smoothness_times(&direction);
            image.iter_mut().zip(&direction).zip(hessians).for_each(|((image, &d), &a)| *image += a * d);
            let curvature = inner(&direction, &image);
            if curvature.is_nan() || curvature <= 0.0 {
                break;
            }
            let step = size / curvature;
            x.iter_mut().zip(&direction).for_each(|(x, &d)| *x += step * d);
            residual.iter_mut().zip(&image).for_each(|(r, &image)| *r -= step * image);
            let z = scaled(&residual);
            let next = inner(&residual, &z);
            if next < TOLERANCE * first {
                break;
            }
            direction.iter_mut().zip(&z).for_each(|(d, &z)| *d = z + next / size * *d);
            size = next;
        }
        x
    }
}
