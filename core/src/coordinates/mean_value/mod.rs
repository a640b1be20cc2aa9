//! Mean value coordinates of a closed triangle mesh (Ju, Schaefer and Warren 2005), in mean-vector form.
//!
//! Seen from a point `x`, a face covers a spherical triangle with corners `u_i`, the unit vectors from `x` to its vertices.
//! Its mean vector is `m = ½ Σ θ_i n_i` over its three edges: `θ_i` the angle an edge is seen under and `n_i` the unit
//! normal of the plane through `x` and the edge. The weights are the solution of `Σ w_i d_i u_i = m`. Each edge term enters
//! two faces with opposite signs, so the mean vectors of a closed cage add up to zero whatever the rounding of the terms, and
//! affine reproduction depends only on the three-by-three solves. What rounding leaves too little of is computed again in
//! 192 bits.

mod gradient;

use super::doubt::{Mended, TOLERANCE, is_kept, is_unreliable, mend_thin};
use super::{ByPoint, CoordinateSystem, Coordinates, CoordinatesError, careful};
use crate::cage::{Cage, Edge};
use crate::mesh::{self, Point};
use crate::simd::{LANES, Lanes, angle, cross, dot, multiversion, zeros};
use faer::MatMut;
use rayon::prelude::*;

/// Mean value coordinates: one unknown per cage vertex, defined inside and outside the cage.
#[derive(Clone, Copy, Debug, Default)]
pub struct MeanValue;

/// Closer to a vertex than this fraction of the cage's diagonal, a point is looked at closely.
const VERTEX_TOLERANCE: f64 = 1e-13;
/// So is one that sees an edge under an angle whose sine is below this, from between its ends.
const EDGE_TOLERANCE: f64 = 1e-11;
/// Points one parallel task computes: a few lane groups.
const TASK_POINTS: usize = 8 * LANES;

impl CoordinateSystem for MeanValue {
    fn name(&self) -> &'static str {
        "mvc"
    }

    fn columns(&self, cage: &Cage) -> usize {
        cage.vertices().len()
    }

    fn rest_values(&self, cage: &Cage) -> Vec<Point> {
        cage.vertices().to_vec()
    }

    fn by_point(&self) -> Option<ByPoint> {
        Some(coordinates)
    }

    fn coordinates(&self, cage: &Cage, points: &[Point]) -> Result<Coordinates, CoordinatesError> {
        Ok(coordinates(cage, points))
    }
}

fn coordinates(cage: &Cage, points: &[Point]) -> Coordinates {
    let mut phi = zeros(points.len(), cage.vertices().len());
    let outside = phi
        .as_mut()
        .par_row_chunks_mut(TASK_POINTS)
        .enumerate()
        .map_init(
            || Scratch::new(cage),
            |scratch, (task, rows)| task_coordinates(cage, points, task * TASK_POINTS, rows, scratch),
        )
        .reduce(Vec::new, |mut a, b| {
            a.extend(b);
            a
        });
    Coordinates { phi, outside, refinement: None, plan: None }
}

/// Working memory of one task; every entry holds one lane group.
pub(super) struct Scratch {
    /// Unit vectors from the points to each cage vertex.
    pub(super) directions: Vec<[Lanes; 3]>,
    /// Reciprocal distances to each cage vertex.
    pub(super) nearness: Vec<Lanes>,
    /// Per edge: half mean-vector term `½ θ n`, and the factor that turns it into `u_a × u_b`.
    pub(super) edges: Vec<[Lanes; 4]>,
    pub(super) weights: Vec<Lanes>,
    pub(super) mended: Mended,
}

impl Scratch {
    fn new(cage: &Cage) -> Self {
        let m = cage.vertices().len();
        Self {
            directions: vec![[Lanes::ZERO; 3]; m],
            nearness: vec![Lanes::ZERO; m],
            edges: vec![[Lanes::ZERO; 4]; cage.edges().len()],
            weights: vec![Lanes::ZERO; m],
            mended: Mended::default(),
        }
    }
}

/// Fills `rows`, the coordinates of the points from `first` on, and returns those points that lie outside.
fn task_coordinates(
    cage: &Cage,
    points: &[Point],
    first: usize,
    mut rows: MatMut<'_, f64>,
    scratch: &mut Scratch,
) -> Vec<u32> {
    let mut outsiders = Vec::new();
    let count = rows.nrows();
    let mut start = 0;
    while start < count {
        let filled = LANES.min(count - start);
        // A last, partly filled group repeats its last point.
        let at = |l: usize| points[first + start + l.min(filled - 1)];
        let mut x = [Lanes::ZERO; 3];
        for l in 0..LANES {
            for k in 0..3 {
                x[k].0[l] = at(l)[k];
            }
        }
        let Sums { total, on, suspect } = group_weights(cage, x, scratch);
        let scale = total.map(|t| 1.0 / t);
        for (j, &weight) in scratch.weights.iter().enumerate() {
            let values = (weight * scale).0;
            for l in 0..filled {
                rows[(start + l, j)] = values[l];
            }
        }
        for l in 0..filled {
            let careful = match on[l] {
                On::Nothing => suspect[l] && is_unreliable(cage, scratch, l, total.0[l]),
                On::Vertex(vertex) if at(l) == cage.vertices()[vertex] => {
                    set_row(&mut rows, start + l, &[(vertex, 1.0)]);
                    continue;
                }
                On::Edge([a, b]) if careful::is_on_edge(cage.vertices()[a], cage.vertices()[b], at(l)) => {
                    let [to_a, to_b] = [a, b].map(|v| distance(at(l), cage.vertices()[v]));
                    set_row(&mut rows, start + l, &[(a, to_b / (to_a + to_b)), (b, to_a / (to_a + to_b))]);
                    continue;
                }
                On::Vertex(_) | On::Edge(_) => true,
            };
            let outside = if careful && at(l).iter().all(|c| c.is_finite()) {
                let row = careful::row(cage, at(l));
                for (j, &value) in row.values.iter().enumerate() {
                    rows[(start + l, j)] = value;
                }
                row.outside
            } else {
                total.0[l] <= 0.0
            };
            if outside {
                outsiders.push((first + start + l) as u32);
            }
        }
        start += filled;
    }
    outsiders
}

/// What of the cage a point may lie on, where the weights have no finite limit.
#[derive(Clone, Copy)]
enum On {
    Nothing,
    Vertex(usize),
    Edge([usize; 2]),
}

/// What the weights of one lane group add up to.
struct Sums {
    total: Lanes,
    on: [On; LANES],
    /// Rows whose entries may be off by more than [`TOLERANCE`].
    suspect: [bool; LANES],
}

fn set_row(rows: &mut MatMut<'_, f64>, row: usize, entries: &[(usize, f64)]) {
    for j in 0..rows.ncols() {
        rows[(row, j)] = 0.0;
    }
    for &(j, value) in entries {
        rows[(row, j)] = value;
    }
}

fn distance(a: Point, b: Point) -> f64 {
    mesh::norm([a[0] - b[0], a[1] - b[1], a[2] - b[2]])
}

multiversion! {
    /// Unnormalised weights of one lane group, left in the scratch; returns their sums.
    fn group_weights(cage: &Cage, x: [Lanes; 3], scratch: &mut Scratch) -> Sums = group_weights_generic;
}

#[inline(always)]
fn group_weights_generic(cage: &Cage, x: [Lanes; 3], scratch: &mut Scratch) -> Sums {
    let mut on = [On::Nothing; LANES];
    scratch.mended = Mended::default();
    let near_vertex = VERTEX_TOLERANCE * cage.diagonal();
    for (j, v) in cage.vertices().iter().enumerate() {
        let r = [Lanes::splat(v[0]) - x[0], Lanes::splat(v[1]) - x[1], Lanes::splat(v[2]) - x[2]];
        let d = dot(&r, &r).sqrt();
        let inverse = d.map(|d| 1.0 / d);
        scratch.nearness[j] = inverse;
        let direction = &mut scratch.directions[j];
        direction[0] = r[0] * inverse;
        direction[1] = r[1] * inverse;
        direction[2] = r[2] * inverse;
        scratch.weights[j] = Lanes::ZERO;
        if d.any(d, |d, _| d <= near_vertex) {
            note_vertex(&mut on, j, &d, near_vertex);
        }
    }
    for (k, edge) in cage.edges().iter().enumerate() {
        let a = &scratch.directions[edge.vertices[0] as usize];
        let b = &scratch.directions[edge.vertices[1] as usize];
        let c = cross(a, b);
        let s2 = dot(&c, &c);
        let s = s2.sqrt();
        let t = dot(a, b);
        let theta = angle(s, t);
        let inverse = (theta * s).map(|p| if p > 0.0 { 1.0 / p } else { 0.0 });
        let degenerate = inverse.map(|i| if i > 0.0 { 0.0 } else { 1.0 });
        let half = theta * theta * inverse * 0.5 + degenerate * 0.5;
        let back = s2 * inverse * 2.0 + degenerate * 2.0;
        // One by one: an array would be built on the stack and copied.
        let term = &mut scratch.edges[k];
        term[0] = c[0] * half;
        term[1] = c[1] * half;
        term[2] = c[2] * half;
        term[3] = back;
        if s.any(t, |s, t| (s < EDGE_TOLERANCE) & (t < 0.0)) {
            note_edge(&mut on, edge, &s, &t);
        }
    }
    // The largest square of what a face loses, over the distances.
    let mut worst = Lanes::ZERO;
    for face in cage.faces() {
        let [e0, e1, e2] = face.edges.map(|e| &scratch.edges[e as usize]);
        let [s0, s1, s2] = face.signs;
        let g0 = [e0[0] * s0, e0[1] * s0, e0[2] * s0];
        let g1 = [e1[0] * s1, e1[1] * s1, e1[2] * s1];
        let g2 = [e2[0] * s2, e2[1] * s2, e2[2] * s2];
        let (back0, back1, back2) = (e0[3], e1[3], e2[3]);
        let m = [g0[0] + g1[0] + g2[0], g0[1] + g1[1] + g2[1], g0[2] + g1[2] + g2[2]];
        let [v0, v1, v2] = face.vertices.map(|v| v as usize);
        let det = dot(&scratch.directions[v0], &g0) * back0;
        let inverse = det.map(|d| 1.0 / d);
        let mut w = [dot(&m, &g0) * back0 * inverse, dot(&m, &g1) * back1 * inverse, dot(&m, &g2) * back2 * inverse];
        let inverse2 = inverse * inverse;
        let width2 = dot(&g0, &g0) + dot(&g1, &g1);
        let thinness = width2 * inverse2;
        // What rounding does to the sine of the face's height, it does to all three weights.
        let mut loss = thinness + dot(&w, &w) * inverse2;
        if thinness.any(thinness, |q, _| !is_kept(q)) {
            mend_thin(cage, scratch, face, x, thinness, &m, &mut loss, &mut w);
        }
        worst = worst.zip(loss, |a, b| if a < b { b } else { a });
        scratch.weights[v0] = scratch.weights[v0] + w[0];
        scratch.weights[v1] = scratch.weights[v1] + w[1];
        scratch.weights[v2] = scratch.weights[v2] + w[2];
    }
    let mut total = Lanes::ZERO;
    let mut nearest = Lanes::ZERO;
    let mut largest = Lanes::ZERO;
    for (weight, &nearness) in scratch.weights.iter_mut().zip(&scratch.nearness) {
        *weight = *weight * nearness;
        total = total + *weight;
        nearest = nearest.zip(nearness, |a, b| if a < b { b } else { a });
        largest = largest.zip(*weight, |a, b| if a < b.abs() { b.abs() } else { a });
    }
    let mut suspect = [false; LANES];
    for l in 0..LANES {
        let error = f64::EPSILON * (worst.0[l].sqrt() * nearest.0[l] + largest.0[l]);
        let relative = error / total.0[l].abs();
        suspect[l] = relative.is_nan() || relative > TOLERANCE;
    }
    Sums { total, on, suspect }
}

// Kept out of the loops: the compiler would otherwise split the lanes as these few entries ask for, and the roots with them.

#[cold]
#[inline(never)]
fn note_vertex(on: &mut [On; LANES], vertex: usize, distances: &Lanes, near: f64) {
    for l in 0..LANES {
        if distances.0[l] <= near {
            on[l] = On::Vertex(vertex);
        }
    }
}

#[cold]
#[inline(never)]
fn note_edge(on: &mut [On; LANES], edge: &Edge, sines: &Lanes, cosines: &Lanes) {
    for l in 0..LANES {
        if sines.0[l] < EDGE_TOLERANCE && cosines.0[l] < 0.0 && matches!(on[l], On::Nothing) {
            on[l] = On::Edge(edge.vertices.map(|v| v as usize));
        }
    }
}
