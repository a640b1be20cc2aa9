//! Mean value coordinates as a function of the cage, in single precision: values, and derivatives
//! by the cage's vertices in reverse mode.
//!
//! With `W` the unnormalised weights, `Φ = W/ΣW`, and per face `w_i = (g_i·m)/(det d_i)`, where
//! `g_i = u_j × u_k`, `det = u_0·g_0` and `m = Σ f_e g_e`, `f = θ/(2 sin θ)` a function of the
//! cosine: smooth away from the cage's faces. A face seen edge-on has weights of zero.

use super::MeanValue;
use crate::cage::{Cage, Face};
use crate::simd::{LANES, Singles, cross, dot, half_angle_over_sine, half_angle_over_sine_slope, multiversion, store};
use cager_geometry::linalg::zeros;
use cager_geometry::mesh::Point;
use faer::{Mat, MatRef};
use rayon::prelude::*;

/// Points of one task: gradients are added up by tasks, whatever the number of threads.
const TASK_POINTS: usize = 16 * LANES;
/// Square of the sine under which faces are seen edge-on: rounding outweighs their derivatives.
const EDGE_ON: f32 = 1e-6;
/// Least square of an edge's sine.
const TOUCHING: f32 = 1e-12;

impl MeanValue {
    /// `Φ`, n × m, for points off the cage's surface: accurate to about 1e-4, mostly far better,
    /// without the special cases at the surface and of thin cages.
    pub fn smooth_coordinates(self, cage: &Cage, points: &[Point]) -> Mat<f32> {
        let vertices = Unit::of(cage).vertices(cage);
        let mut phi = zeros(points.len(), cage.vertices().len());
        phi.as_mut().par_row_chunks_mut(TASK_POINTS).enumerate().for_each_init(
            || Scratch::new(cage),
            |scratch, (task, mut rows)| {
                let points = &points[task * TASK_POINTS..];
                for start in (0..rows.nrows()).step_by(LANES) {
                    let filled = LANES.min(rows.nrows() - start);
                    let x = Unit::of(cage).lanes(&points[start..start + filled]);
                    let scale = forward(cage, &vertices, x, scratch);
                    store(rows.as_mut(), start, scratch.weights.iter().map(|&weight| (weight * scale).0));
                }
            },
        );
        phi
    }

    /// Gradient of `Σ_ij g_ij Φ_ij` by the cage's vertices, v × 3, where `upstream` holds `g`, n ×
    /// m, and `Φ` is [`Self::smooth_coordinates`].
    pub fn gradient(self, cage: &Cage, points: &[Point], upstream: MatRef<'_, f32>) -> Vec<Point> {
        let unit = Unit::of(cage);
        let vertices = unit.vertices(cage);
        let tasks = points.len().div_ceil(TASK_POINTS);
        let parts: Vec<Vec<Point>> = (0..tasks)
            .into_par_iter()
            .map_init(
                || (Scratch::new(cage), Adjoint::new(cage)),
                |(scratch, adjoint), task| {
                    let first = task * TASK_POINTS;
                    let count = TASK_POINTS.min(points.len() - first);
                    adjoint.total.fill([Singles::ZERO; 3]);
                    for start in (first..first + count).step_by(LANES) {
                        let filled = LANES.min(first + count - start);
                        let x = unit.lanes(&points[start..start + filled]);
                        let scale = forward(cage, &vertices, x, scratch);
                        load(upstream.subrows(start, filled), scale, scratch, &mut adjoint.weights);
                        backward(cage, scratch, adjoint);
                    }
                    adjoint.total.iter().map(|t| t.map(|c| c.0.iter().copied().map(f64::from).sum())).collect()
                },
            )
            .collect();
        let mut sum = vec![[0.0; 3]; vertices.len()];
        for part in parts {
            for (total, value) in sum.iter_mut().zip(part) {
                for k in 0..3 {
                    total[k] += value[k] * unit.scale;
                }
            }
        }
        sum
    }
}

/// Positions that fit single precision: differences from a vertex over the cage's diagonal.
#[derive(Clone, Copy)]
struct Unit {
    origin: Point,
    scale: f64,
}

impl Unit {
    fn of(cage: &Cage) -> Self {
        Self { origin: cage.vertices()[0], scale: 1.0 / cage.diagonal() }
    }

    fn single(&self, p: Point) -> [f32; 3] {
        std::array::from_fn(|k| ((p[k] - self.origin[k]) * self.scale) as f32)
    }

    fn vertices(&self, cage: &Cage) -> Vec<[f32; 3]> {
        cage.vertices().iter().map(|&v| self.single(v)).collect()
    }

    /// A lane group of points; a last, partly filled one repeats its last point.
    fn lanes(&self, points: &[Point]) -> [Singles; 3] {
        let mut x = [Singles::ZERO; 3];
        for l in 0..LANES {
            let p = self.single(points[l.min(points.len() - 1)]);
            for k in 0..3 {
                x[k].0[l] = p[k];
            }
        }
        x
    }
}

/// Values of the forward pass; every entry holds one lane group.
struct Scratch {
    /// Unit vectors from the points to each cage vertex.
    directions: Vec<[Singles; 3]>,
    /// Reciprocal distances to each cage vertex.
    nearness: Vec<Singles>,
    edges: Vec<EdgeTerms>,
    /// Unnormalised weights.
    weights: Vec<Singles>,
}

#[derive(Clone, Copy)]
struct EdgeTerms {
    /// `c = u_a × u_b`, and its square.
    cross: [Singles; 3],
    square: Singles,
    /// `f = θ/(2 sin θ)`: the mean-vector term is `f c`.
    ratio: Singles,
}

impl Scratch {
    fn new(cage: &Cage) -> Self {
        let m = cage.vertices().len();
        let edge = EdgeTerms { cross: [Singles::ZERO; 3], square: Singles::ZERO, ratio: Singles::ZERO };
        Self {
            directions: vec![[Singles::ZERO; 3]; m],
            nearness: vec![Singles::ZERO; m],
            edges: vec![edge; cage.edges().len()],
            weights: vec![Singles::ZERO; m],
        }
    }
}

/// Accumulators of the backward pass.
struct Adjoint {
    /// Derivative by each weight times the reciprocal distance, `∂E/∂W_j / d_j`.
    weights: Vec<Singles>,
    /// Derivative by each unit vector.
    directions: Vec<[Singles; 3]>,
    /// Derivative by each edge's mean-vector term, then by its cross product.
    edges: Vec<[Singles; 6]>,
    /// Derivative by the vertices, over all lane groups of a task.
    total: Vec<[Singles; 3]>,
}

impl Adjoint {
    fn new(cage: &Cage) -> Self {
        let m = cage.vertices().len();
        Self {
            weights: vec![Singles::ZERO; m],
            directions: vec![[Singles::ZERO; 3]; m],
            edges: vec![[Singles::ZERO; 6]; cage.edges().len()],
            total: vec![[Singles::ZERO; 3]; m],
        }
    }
}

/// Derivatives by the weights, `(g_ij − Σ_k g_ik Φ_ik)/ΣW` over the distances.
fn load(upstream: MatRef<'_, f32>, scale: Singles, scratch: &Scratch, out: &mut [Singles]) {
    let mut mean = Singles::ZERO;
    for ((value, column), &weight) in out.iter_mut().zip(upstream.col_iter()).zip(&scratch.weights) {
        *value = Singles::ZERO;
        for (l, &g) in column.iter().enumerate() {
            value.0[l] = g;
        }
        mean = mean + *value * weight;
    }
    mean = mean * scale;
    for (value, &near) in out.iter_mut().zip(&scratch.nearness) {
        *value = (*value - mean) * scale * near;
    }
}

multiversion! {
    /// Unnormalised weights of one lane group, left in the scratch; returns one over their sums.
    fn forward(cage: &Cage, vertices: &[[f32; 3]], x: [Singles; 3], scratch: &mut Scratch) -> Singles {
        for (j, v) in vertices.iter().enumerate() {
            let r = [Singles::splat(v[0]) - x[0], Singles::splat(v[1]) - x[1], Singles::splat(v[2]) - x[2]];
            let square = dot(&r, &r).map(|d| if d < f32::MIN_POSITIVE { f32::MIN_POSITIVE } else { d });
            let inverse = square.sqrt().map(|d| 1.0 / d);
            scratch.nearness[j] = inverse;
            let direction = &mut scratch.directions[j];
            direction[0] = r[0] * inverse;
            direction[1] = r[1] * inverse;
            direction[2] = r[2] * inverse;
            scratch.weights[j] = Singles::ZERO;
        }
        for (edge, out) in cage.edges().iter().zip(&mut scratch.edges) {
            let [a, b] = edge.vertices.map(|v| &scratch.directions[v as usize]);
            // The difference keeps the relative accuracy where the edge is seen under a small angle.
            let c = cross(a, &[b[0] - a[0], b[1] - a[1], b[2] - a[2]]);
            let square = dot(&c, &c);
            out.cross[0] = c[0];
            out.cross[1] = c[1];
            out.cross[2] = c[2];
            out.square = square;
            out.ratio = half_angle_over_sine(dot(a, b), inverse_sine(square));
        }
        for face in cage.faces() {
            let seen = FaceTerms::new(face, scratch);
            for i in 0..3 {
                let weight = &mut scratch.weights[face.vertices[i] as usize];
                *weight = *weight + dot(&seen.mean, &seen.g[i]) * seen.inverse;
            }
        }
        let mut total = Singles::ZERO;
        for (weight, &nearness) in scratch.weights.iter_mut().zip(&scratch.nearness) {
            *weight = *weight * nearness;
            total = total + *weight;
        }
        total.map(|t| 1.0 / t)
    }
}

#[inline(always)]
fn inverse_sine(square: Singles) -> Singles {
    square.map(|s| if s < TOUCHING { TOUCHING } else { s }).sqrt().map(|s| 1.0 / s)
}

/// Terms of one face for the points of a lane group.
struct FaceTerms {
    /// `u_j × u_k`, by the corner opposite.
    g: [[Singles; 3]; 3],
    /// Mean vector `m`.
    mean: [Singles; 3],
    /// `1/det`; 0 where the face is seen edge-on.
    inverse: Singles,
}

impl FaceTerms {
    #[inline(always)]
    fn new(face: &Face, scratch: &Scratch) -> Self {
        let [e0, e1, e2] = face.edges.map(|e| &scratch.edges[e as usize]);
        let [s0, s1, s2] = face.signs.map(|s| s as f32);
        let g0 = [e0.cross[0] * s0, e0.cross[1] * s0, e0.cross[2] * s0];
        let g1 = [e1.cross[0] * s1, e1.cross[1] * s1, e1.cross[2] * s1];
        let g2 = [e2.cross[0] * s2, e2.cross[1] * s2, e2.cross[2] * s2];
        let mean = [
            g0[0] * e0.ratio + g1[0] * e1.ratio + g2[0] * e2.ratio,
            g0[1] * e0.ratio + g1[1] * e1.ratio + g2[1] * e2.ratio,
            g0[2] * e0.ratio + g1[2] * e1.ratio + g2[2] * e2.ratio,
        ];
        let [u0, u1] = [0, 1].map(|i| &scratch.directions[face.vertices[i] as usize]);
        let det = dot(&[u0[0] - u1[0], u0[1] - u1[1], u0[2] - u1[2]], &g0);
        let least = e0.square * e1.square * EDGE_ON;
        let inverse = det.zip(least, |d, least| if d * d > least { 1.0 / d } else { 0.0 });
        Self { g: [g0, g1, g2], mean, inverse }
    }
}

multiversion! {
    /// Adds the derivative by the vertices for one lane group.
    fn backward(cage: &Cage, scratch: &Scratch, adjoint: &mut Adjoint) {
        let Adjoint { weights, directions, edges, total } = adjoint;
        let (weights, directions) = (weights.as_slice(), directions.as_mut_slice());
        directions.fill([Singles::ZERO; 3]);
        for face in cage.faces() {
            let seen = FaceTerms::new(face, scratch);
            let vertices = face.vertices.map(|v| v as usize);
            // Written out: the closure of a `map` would be compiled for another instruction set.
            let [v0, v1, v2] = vertices;
            let by_face @ [a0, a1, a2] =
                [weights[v0] * seen.inverse, weights[v1] * seen.inverse, weights[v2] * seen.inverse];
            let [g0, g1, g2] = &seen.g;
            // ∂E/∂m, and −∂E/∂det.
            let by_mean = [
                g0[0] * a0 + g1[0] * a1 + g2[0] * a2,
                g0[1] * a0 + g1[1] * a1 + g2[1] * a2,
                g0[2] * a0 + g1[2] * a1 + g2[2] * a2,
            ];
            let by_det = dot(&seen.mean, &by_mean) * seen.inverse;
            for i in 0..3 {
                let sign = face.signs[i] as f32;
                let edge = &mut edges[face.edges[i] as usize];
                let own = by_face[i] * sign;
                for k in 0..3 {
                    edge[k] = edge[k] + by_mean[k] * sign;
                    edge[3 + k] = edge[3 + k] + seen.mean[k] * own;
                }
                let direction = &mut directions[vertices[i]];
                for k in 0..3 {
                    direction[k] = direction[k] - seen.g[i][k] * by_det;
                }
            }
        }
        for ((edge, term), by) in cage.edges().iter().zip(&scratch.edges).zip(edges) {
            let [a, b] = edge.vertices.map(|v| v as usize);
            let (ua, ub) = (scratch.directions[a], scratch.directions[b]);
            let slope = half_angle_over_sine_slope(dot(&ua, &ub), inverse_sine(term.square));
            let by_t = (by[0] * term.cross[0] + by[1] * term.cross[1] + by[2] * term.cross[2]) * slope;
            let by_c = [by[3] + by[0] * term.ratio, by[4] + by[1] * term.ratio, by[5] + by[2] * term.ratio];
            let (to_a, to_b) = (cross(&ub, &by_c), cross(&by_c, &ua));
            for k in 0..3 {
                directions[a][k] = directions[a][k] + to_a[k] + ub[k] * by_t;
                directions[b][k] = directions[b][k] + to_b[k] + ua[k] * by_t;
            }
            // For the next lane group.
            *by = [Singles::ZERO; 6];
        }
        for j in 0..total.len() {
            let (u, by, near) = (&scratch.directions[j], &directions[j], scratch.nearness[j]);
            let radial = dot(u, by) * near + weights[j] * scratch.weights[j];
            let total = &mut total[j];
            for k in 0..3 {
                total[k] = total[k] + by[k] * near - u[k] * radial;
            }
        }
    }
}
