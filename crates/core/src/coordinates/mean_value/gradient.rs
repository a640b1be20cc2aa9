//! Mean value coordinates as a function of the cage: values, and the derivative of any function of them by the cage's vertices in
//! reverse mode.
//!
//! With `W` the unnormalised weights, `Φ = W/ΣW`, and per face `w_i = (g_i·m)/(det d_i)`, where `g_i = u_j × u_k`,
//! `det = u_0·g_0` and `m = ½ Σ θ_e n_e`; all of it is smooth away from the cage's faces. A face that a point sees edge-on has
//! weights of zero, their limit beside the face.

use super::{GRADIENT, MeanValue, store};
use crate::cage::{Cage, Edge, Face};
use crate::simd::{LANES, Lanes, angle, cross, dot, gather, multiversion};
use cager_geometry::linalg::zeros;
use cager_geometry::mesh::Point;
use faer::{Mat, MatRef};
use rayon::prelude::*;

/// Points of one task: partial gradients are added up task by task, so that the sum does not depend on the number of threads.
const TASK_POINTS: usize = 32 * LANES;
/// Faces whose determinant is below this are seen edge-on.
const EDGE_ON: f64 = 1e-11;
/// Edges seen under a smaller sine take a series for the derivative.
const NARROW: f64 = 1e-3;
/// Edges seen under a smaller sine take the limit for the value too.
const TOUCHING: f64 = 1e-12;

impl MeanValue {
    /// `Φ`, n × m, for points off the cage's surface: accurate to about 1e-9, without the special cases of [`coordinates`] for points at the surface
    /// and thin cages. Runs on the current rayon pool; the result does not depend on it.
    ///
    /// [`coordinates`]: crate::coordinates::CoordinateSystem::coordinates
    pub fn smooth_coordinates(self, cage: &Cage, points: &[Point]) -> Mat<f64> {
        let mut phi = zeros(points.len(), cage.vertices().len());
        phi.as_mut().par_row_chunks_mut(TASK_POINTS).enumerate().for_each_init(
            || Scratch::new(cage),
            |scratch, (task, mut rows)| {
                let points = &points[task * TASK_POINTS..];
                for start in (0..rows.nrows()).step_by(LANES) {
                    let filled = LANES.min(rows.nrows() - start);
                    let scale = forward(cage, gather(|l| points[start + l.min(filled - 1)]), scratch);
                    store(rows.as_mut().subrows_mut(start, filled), &scratch.weights, scale);
                }
            },
        );
        phi
    }

    /// Gradient of `Σ_ij g_ij Φ_ij` by the cage's vertices, v × 3, where `upstream` holds `g`, n × m, and `phi` is what
    /// [`Self::smooth_coordinates`] gives for the same points. Runs on the current rayon pool; the result does not depend on it.
    pub fn gradient(
        self,
        cage: &Cage,
        points: &[Point],
        phi: MatRef<'_, f64>,
        upstream: MatRef<'_, f64>,
    ) -> Vec<Point> {
        let m = cage.vertices().len();
        let tasks = points.len().div_ceil(TASK_POINTS);
        let parts: Vec<Vec<Point>> = (0..tasks)
            .into_par_iter()
            .map_init(
                || (Scratch::new(cage), Adjoint::new(cage)),
                |(scratch, adjoint), task| {
                    let first = task * TASK_POINTS;
                    let count = TASK_POINTS.min(points.len() - first);
                    adjoint.total.fill([Lanes::ZERO; 3]);
                    for start in (first..first + count).step_by(LANES) {
                        let filled = LANES.min(first + count - start);
                        let scale = forward(cage, gather(|l| points[start + l.min(filled - 1)]), scratch);
                        let rows = (phi.subrows(start, filled), upstream.subrows(start, filled));
                        load(rows, scale, &scratch.nearness, &mut adjoint.weights);
                        backward(cage, scratch, adjoint);
                    }
                    adjoint.total.iter().map(|t| t.map(|c| c.0.iter().sum())).collect()
                },
            )
            .collect();
        let mut sum = vec![[0.0; 3]; m];
        for part in parts {
            for (total, value) in sum.iter_mut().zip(part) {
                for k in 0..3 {
                    total[k] += value[k];
                }
            }
        }
        sum
    }
}

/// Values of the forward pass: unit vectors `u`, reciprocal distances `1/d` and unnormalised weights `W`. Per edge: `c = u_a × u_b`; `f = θ/(2 sin θ)`, so
/// that the mean-vector term is `f c`; and `(df/ds)/s`.
type Scratch = super::Scratch<GRADIENT>;

/// Accumulators of the backward pass.
struct Adjoint {
    /// Derivative by each weight times the reciprocal distance, `∂E/∂W_j / d_j`.
    weights: Vec<Lanes>,
    /// Derivative by each unit vector.
    directions: Vec<[Lanes; 3]>,
    /// Derivative by each edge's mean-vector term, then by its cross product where that enters on its own.
    edges: Vec<[Lanes; 6]>,
    /// Derivative by the vertices, over all lane groups of a task.
    total: Vec<[Lanes; 3]>,
}

impl Adjoint {
    fn new(cage: &Cage) -> Self {
        let m = cage.vertices().len();
        Self {
            weights: vec![Lanes::ZERO; m],
            directions: vec![[Lanes::ZERO; 3]; m],
            edges: vec![[Lanes::ZERO; 6]; cage.edges().len()],
            total: vec![[Lanes::ZERO; 3]; m],
        }
    }
}

/// Derivatives by the weights from those by their quotients: `(g_ij − Σ_k g_ik Φ_ik)/ΣW`, over the distances. Lanes that repeat the last point
/// contribute zero.
fn load(rows: (MatRef<'_, f64>, MatRef<'_, f64>), scale: Lanes, nearness: &[Lanes], out: &mut [Lanes]) {
    let (phi, upstream) = rows;
    let mut mean = Lanes::ZERO;
    for j in 0..out.len() {
        let mut value = Lanes::ZERO;
        for l in 0..phi.nrows() {
            value.0[l] = upstream[(l, j)];
            mean.0[l] += upstream[(l, j)] * phi[(l, j)];
        }
        out[j] = value;
    }
    let mut counted = Lanes::ZERO;
    for l in 0..phi.nrows() {
        counted.0[l] = scale.0[l];
    }
    for (value, &near) in out.iter_mut().zip(nearness) {
        *value = (*value - mean) * counted * near;
    }
}

multiversion! {
    /// Unnormalised weights of one lane group, left in the scratch; returns one over their sums.
    fn forward(cage: &Cage, x: [Lanes; 3], scratch: &mut Scratch) -> Lanes = forward_generic;
}

multiversion! {
    /// Adds the derivative by the vertices for one lane group.
    fn backward(cage: &Cage, scratch: &Scratch, adjoint: &mut Adjoint) -> () = backward_generic;
}

#[inline(always)]
fn forward_generic(cage: &Cage, x: [Lanes; 3], scratch: &mut Scratch) -> Lanes {
    for (j, v) in cage.vertices().iter().enumerate() {
        let r = [Lanes::splat(v[0]) - x[0], Lanes::splat(v[1]) - x[1], Lanes::splat(v[2]) - x[2]];
        let inverse = dot(&r, &r).sqrt().map(|d| 1.0 / if d < f64::MIN_POSITIVE { f64::MIN_POSITIVE } else { d });
        scratch.nearness[j] = inverse;
        let direction = &mut scratch.directions[j];
        direction[0] = r[0] * inverse;
        direction[1] = r[1] * inverse;
        direction[2] = r[2] * inverse;
        scratch.weights[j] = Lanes::ZERO;
    }
    for (edge, out) in cage.edges().iter().zip(&mut scratch.edges) {
        edge_term(edge, &scratch.directions, out);
    }
    for face in cage.faces() {
        let seen = FaceTerms::new(face, &scratch.directions, &scratch.edges);
        for i in 0..3 {
            let weight = &mut scratch.weights[face.vertices[i] as usize];
            *weight = *weight + dot(&seen.mean, &seen.g[i]) * seen.inverse;
        }
    }
    let mut total = Lanes::ZERO;
    for (weight, &nearness) in scratch.weights.iter_mut().zip(&scratch.nearness) {
        *weight = *weight * nearness;
        total = total + *weight;
    }
    total.map(|t| 1.0 / t)
}

#[inline(always)]
fn edge_term(edge: &Edge, directions: &[[Lanes; 3]], out: &mut [Lanes; GRADIENT]) {
    let [a, b] = edge.vertices.map(|v| &directions[v as usize]);
    let c = cross(a, b);
    let s = dot(&c, &c).sqrt();
    let t = dot(a, b);
    let theta = angle(s, t);
    let inverse = s.map(|s| 1.0 / if s < TOUCHING { TOUCHING } else { s });
    let touching = s.map(|s| if s < TOUCHING { 1.0 } else { 0.0 });
    let ratio = theta * inverse * (Lanes::splat(1.0) - touching) + touching;
    // (t s − θ)/s³, which cancels where θ is small: −2/3 − s²/5 + O(s⁴).
    let series = s * s * -0.2 - Lanes::splat(2.0 / 3.0);
    let narrow = s.zip(t, |s, t| if s < NARROW && t > 0.0 { 1.0 } else { 0.0 });
    let slope = (t - ratio) * inverse * inverse * (Lanes::splat(1.0) - narrow) + series * narrow;
    out[0] = c[0];
    out[1] = c[1];
    out[2] = c[2];
    out[3] = ratio * 0.5;
    out[4] = slope * 0.5;
}

/// Terms of one face for the points of a lane group.
struct FaceTerms {
    /// `u_j × u_k`, by the corner opposite.
    g: [[Lanes; 3]; 3],
    /// Mean vector `m`.
    mean: [Lanes; 3],
    /// `1/det`; 0 where the face is seen edge-on.
    inverse: Lanes,
}

impl FaceTerms {
    #[inline(always)]
    fn new(face: &Face, directions: &[[Lanes; 3]], edges: &[[Lanes; GRADIENT]]) -> Self {
        let [e0, e1, e2] = face.edges.map(|e| &edges[e as usize]);
        let [s0, s1, s2] = face.signs;
        let g0 = [e0[0] * s0, e0[1] * s0, e0[2] * s0];
        let g1 = [e1[0] * s1, e1[1] * s1, e1[2] * s1];
        let g2 = [e2[0] * s2, e2[1] * s2, e2[2] * s2];
        let mean = [
            g0[0] * e0[3] + g1[0] * e1[3] + g2[0] * e2[3],
            g0[1] * e0[3] + g1[1] * e1[3] + g2[1] * e2[3],
            g0[2] * e0[3] + g1[2] * e1[3] + g2[2] * e2[3],
        ];
        let det = dot(&directions[face.vertices[0] as usize], &g0);
        let inverse = det.map(|d| if d.abs() > EDGE_ON { 1.0 / d } else { 0.0 });
        Self { g: [g0, g1, g2], mean, inverse }
    }
}

#[inline(always)]
fn backward_generic(cage: &Cage, scratch: &Scratch, adjoint: &mut Adjoint) {
    adjoint.directions.fill([Lanes::ZERO; 3]);
    adjoint.edges.fill([Lanes::ZERO; 6]);
    for face in cage.faces() {
        let seen = FaceTerms::new(face, &scratch.directions, &scratch.edges);
        let vertices = face.vertices.map(|v| v as usize);
        let [a0, a1, a2] = vertices.map(|v| adjoint.weights[v] * seen.inverse);
        let [g0, g1, g2] = &seen.g;
        // ∂E/∂m, and −∂E/∂det.
        let by_mean = [
            g0[0] * a0 + g1[0] * a1 + g2[0] * a2,
            g0[1] * a0 + g1[1] * a1 + g2[1] * a2,
            g0[2] * a0 + g1[2] * a1 + g2[2] * a2,
        ];
        let by_det = dot(&seen.mean, &by_mean) * seen.inverse;
        for (i, a) in [a0, a1, a2].into_iter().enumerate() {
            let sign = face.signs[i];
            let edge = &mut adjoint.edges[face.edges[i] as usize];
            let own = a * sign;
            for k in 0..3 {
                edge[k] = edge[k] + by_mean[k] * sign;
                edge[3 + k] = edge[3 + k] + seen.mean[k] * own;
            }
            let direction = &mut adjoint.directions[vertices[i]];
            for k in 0..3 {
                direction[k] = direction[k] - seen.g[i][k] * by_det;
            }
        }
    }
    for ((edge, term), by) in cage.edges().iter().zip(&scratch.edges).zip(&adjoint.edges) {
        let [a, b] = edge.vertices.map(|v| v as usize);
        let c = [term[0], term[1], term[2]];
        let along = by[0] * c[0] + by[1] * c[1] + by[2] * c[2];
        let slope = along * term[4];
        let by_c = [
            by[3] + by[0] * term[3] + c[0] * slope,
            by[4] + by[1] * term[3] + c[1] * slope,
            by[5] + by[2] * term[3] + c[2] * slope,
        ];
        let by_t = along * -0.5;
        let (ua, ub) = (scratch.directions[a], scratch.directions[b]);
        let (to_a, to_b) = (cross(&ub, &by_c), cross(&by_c, &ua));
        for k in 0..3 {
            adjoint.directions[a][k] = adjoint.directions[a][k] + to_a[k] + ub[k] * by_t;
            adjoint.directions[b][k] = adjoint.directions[b][k] + to_b[k] + ua[k] * by_t;
        }
    }
    for j in 0..adjoint.total.len() {
        let (u, by, near) = (&scratch.directions[j], &adjoint.directions[j], scratch.nearness[j]);
        let radial = dot(u, by) * near + adjoint.weights[j] * scratch.weights[j];
        let total = &mut adjoint.total[j];
        for k in 0..3 {
            total[k] = total[k] + by[k] * near - u[k] * radial;
        }
    }
}
