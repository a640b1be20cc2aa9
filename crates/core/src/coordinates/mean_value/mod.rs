//! Mean value coordinates of a closed triangle mesh (Ju, Schaefer and Warren 2005).
//!
//! Seen from a point `x`, a face covers a spherical triangle with corners `u_i`, the unit vectors
//! to its vertices. Its mean vector is `m = ½ Σ θ_i n_i` over its three edges: `θ_i` the angle an
//! edge is seen under and `n_i` the unit normal of the plane through `x` and the edge. The weights
//! solve `Σ w_i d_i u_i = m`. Each edge term enters two faces with opposite signs, so that the mean
//! vectors of a closed cage add up to zero whatever the rounding, and affine reproduction depends
//! on the three-by-three solves alone. These cancel where a face is seen edge-on and where a point
//! lies outside a thin cage or far away: there the weights are integrated, see `integral.rs`.

mod gradient;
mod integral;

use super::{CageValues, CoordinateSystem, Coordinates, PointwiseCoordinates, pointwise_coordinates};
use crate::cage::{Cage, Component, Edge, Face};
use crate::simd::{LANES, Lanes, angle, cross, dot, gather, multiversion, store};
use cager_geometry::linalg::zeros;
use cager_geometry::mesh::Point;
use cager_geometry::vector;
use faer::MatMut;

/// Mean value coordinates: one unknown per cage vertex, defined inside and outside the cage.
#[derive(Clone, Copy, Debug, Default)]
pub struct MeanValue;

/// Closer to a vertex than this fraction of the diagonal, a point has the vertex's coordinates.
const VERTEX_TOLERANCE: f64 = 1e-13;
/// A point that sees an edge from between its ends under a smaller sine lies on the edge.
const EDGE_TOLERANCE: f64 = 1e-11;
/// Estimated error of an entry from which the weights of a face are integrated.
const ENTRY_TOLERANCE: f64 = 1e-11;
/// Length of a face's mean vector from which the plain formula does not cancel.
const SAFE_MEAN_LENGTH: f64 = 0.1;
/// What takes the place of 1/0 where a point lies on a face.
const INV_ZERO: f64 = 1e100;

impl CoordinateSystem for MeanValue {
    fn name(&self) -> &'static str {
        "mvc"
    }

    fn values(&self, cage: &Cage) -> CageValues {
        CageValues::of_vertices(cage)
    }

    fn pointwise(&self) -> Option<PointwiseCoordinates> {
        Some(coordinates)
    }
}

/// In each component of the cage those of the points that it carries.
fn coordinates(cage: &Cage, points: &[Point]) -> Coordinates {
    let Some(components) = cage.components() else { return component_coordinates(cage, points) };
    assert!(cage.carries(points.len()), "the points that the components of the cage carry");
    let (mut phi, mut outside) = (zeros(points.len(), cage.vertices().len()), Vec::new());
    for Component { cage, vertices, points: carried } in components {
        let rows: Vec<u32> = carried.into_iter().flatten().collect();
        let own: Vec<Point> = rows.iter().map(|&row| points[row as usize]).collect();
        let found = component_coordinates(&cage, &own);
        for (column, values) in (vertices.start as usize..).zip(found.phi.col_iter()) {
            rows.iter().zip(values.iter()).for_each(|(&row, &value)| phi[(row as usize, column)] = value);
        }
        outside.extend(found.outside.iter().map(|&place| rows[place as usize]));
    }
    outside.sort_unstable();
    Coordinates { phi, outside, refinement: None, plan: None }
}

fn component_coordinates(cage: &Cage, points: &[Point]) -> Coordinates {
    pointwise_coordinates(
        points.len(),
        cage.vertices().len(),
        || Scratch::new(cage),
        |first, rows, scratch| task_coordinates(cage, points, first, rows, scratch),
    )
}

/// Working memory of one task; every entry holds one lane group.
struct Scratch {
    /// Unit vectors from the points to each cage vertex.
    directions: Vec<[Lanes; 3]>,
    /// Reciprocal distances to each cage vertex.
    nearness: Vec<Lanes>,
    /// Of each edge: `½ θ n`, and the factor that turns it into `u_a × u_b`.
    edges: Vec<[Lanes; 4]>,
    /// Unnormalised weights.
    weights: Vec<Lanes>,
}

impl Scratch {
    fn new(cage: &Cage) -> Self {
        let m = cage.vertices().len();
        Self {
            directions: vec![[Lanes::ZERO; 3]; m],
            nearness: vec![Lanes::ZERO; m],
            edges: vec![[Lanes::ZERO; 4]; cage.edges().len()],
            weights: vec![Lanes::ZERO; m],
        }
    }
}

/// Fills the rows of the points from `first` on; returns the points that lie outside.
fn task_coordinates(
    cage: &Cage,
    points: &[Point],
    first: usize,
    mut rows: MatMut<'_, f64>,
    scratch: &mut Scratch,
) -> Vec<u32> {
    let mut outsiders = Vec::new();
    let count = rows.nrows();
    for start in (0..count).step_by(LANES) {
        let filled = LANES.min(count - start);
        // A last, partly filled group repeats its last point.
        let at = |l: usize| points[first + start + l.min(filled - 1)];
        let Sums { mut total, on, inaccurate } = group_weights(cage, gather(at), scratch);
        for l in 0..filled {
            if inaccurate[l] && matches!(on[l], On::Nothing) {
                total.0[l] = accurate_weights(cage, scratch, at(l), l, total.0[l]);
            }
        }
        let scale = total.map(|t| 1.0 / t);
        store(rows.as_mut(), start, scratch.weights.iter().map(|&weight| (weight * scale).0));
        for l in 0..filled {
            match on[l] {
                On::Nothing if total.0[l] <= 0.0 => outsiders.push((first + start + l) as u32),
                On::Nothing => {}
                On::Vertex(vertex) => set_row(&mut rows, start + l, &[(vertex, 1.0)]),
                On::Edge([a, b]) => {
                    let [to_a, to_b] = [a, b].map(|v| vector::norm(vector::sub(at(l), cage.vertices()[v])));
                    set_row(&mut rows, start + l, &[(a, to_b / (to_a + to_b)), (b, to_a / (to_a + to_b))]);
                }
            }
        }
    }
    outsiders
}

/// What of the cage a point lies on, where the weights have no finite limit.
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
    /// Rows whose entries may be off by more than [`ENTRY_TOLERANCE`].
    inaccurate: [bool; LANES],
}

fn set_row(rows: &mut MatMut<'_, f64>, row: usize, entries: &[(usize, f64)]) {
    for j in 0..rows.ncols() {
        rows[(row, j)] = 0.0;
    }
    for &(j, value) in entries {
        rows[(row, j)] = value;
    }
}

/// Computes the weights of lane l's point again, integrated where rounding matters; their sum.
#[cold]
fn accurate_weights(cage: &Cage, scratch: &mut Scratch, x: Point, l: usize, total: f64) -> f64 {
    for weight in &mut scratch.weights {
        weight.0[l] = 0.0;
    }
    for face in cage.faces() {
        let nearness = face.vertices.map(|v| scratch.nearness[v as usize].0[l]);
        let weights = face_weights(cage, scratch, face, x, l, total);
        for i in 0..3 {
            scratch.weights[face.vertices[i] as usize].0[l] += weights[i] * nearness[i];
        }
    }
    scratch.weights.iter().map(|w| w.0[l]).sum()
}

/// Weights of one face times the distances of its corners.
fn face_weights(cage: &Cage, scratch: &Scratch, face: &Face, x: Point, l: usize, total: f64) -> [f64; 3] {
    let vertices = face.vertices.map(|v| v as usize);
    let edges = face.edges.map(|e| scratch.edges[e as usize].map(|c| c.0[l]));
    let g = [0, 1, 2].map(|i| [0, 1, 2].map(|k| face.signs[i] * edges[i][k]));
    let mean = vector::add(vector::add(g[0], g[1]), g[2]);
    let det = vector::dot(scratch.directions[vertices[0]].map(|c| c.0[l]), g[0]) * edges[0][3];
    let nearness = vertices.map(|v| scratch.nearness[v].0[l]);
    let loss2 = (vector::dot(g[0], g[0]) + vector::dot(g[1], g[1])) / (det * det);
    let nearest = nearness.iter().copied().fold(0.0, f64::max);
    if vector::norm(mean) < SAFE_MEAN_LENGTH && is_inaccurate(loss2, nearest, total) {
        let weights = integral::face_weights(vertices.map(|v| cage.vertices()[v]), x);
        return [0, 1, 2].map(|i| weights[i] / nearness[i]);
    }
    let numerators = [0, 1, 2].map(|i| vector::dot(mean, g[i]) * edges[i][3]);
    let weights = numerators.map(|n| n / det);
    // On the face itself, only the ratios of the weights count.
    if weights.iter().all(|w| w.is_finite()) { weights } else { numerators.map(|n| n * INV_ZERO) }
}

/// Whether rounding may change entries by more than [`ENTRY_TOLERANCE`], from the square of a
/// determinant's amplification, the nearest reciprocal distance and the sum of all weights.
fn is_inaccurate(loss2: f64, nearest: f64, total: f64) -> bool {
    let error = f64::EPSILON * loss2.sqrt() * nearest / total.abs();
    error.is_nan() || error > ENTRY_TOLERANCE
}

multiversion! {
    /// Unnormalised weights of one lane group, left in the scratch; returns their sums.
    fn group_weights(cage: &Cage, x: [Lanes; 3], scratch: &mut Scratch) -> Sums {
        let mut on = [On::Nothing; LANES];
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
        // The largest square of what the determinant of a face amplifies rounding by.
        let mut loss2 = Lanes::splat(1.0);
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
            let w = [dot(&m, &g0) * back0 * inverse, dot(&m, &g1) * back1 * inverse, dot(&m, &g2) * back2 * inverse];
            let own = (dot(&g0, &g0) + dot(&g1, &g1)) * inverse * inverse;
            loss2 = loss2.zip(own, |a, b| if a < b { b } else { a });
            scratch.weights[v0] = scratch.weights[v0] + w[0];
            scratch.weights[v1] = scratch.weights[v1] + w[1];
            scratch.weights[v2] = scratch.weights[v2] + w[2];
        }
        let mut total = Lanes::ZERO;
        let mut nearest = Lanes::ZERO;
        for (weight, &nearness) in scratch.weights.iter_mut().zip(&scratch.nearness) {
            *weight = *weight * nearness;
            total = total + *weight;
            nearest = nearest.zip(nearness, |a, b| if a < b { b } else { a });
        }
        let inaccurate = std::array::from_fn(|l| is_inaccurate(loss2.0[l], nearest.0[l], total.0[l]));
        Sums { total, on, inaccurate }
    }
}

// Kept out of the loops, which the compiler would not vectorise with them inlined.

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
