//! Mean value weights in 192 bits, where double precision leaves no digits of them.
//!
//! The formula is that of `mean_value.rs`, from vectors `r` that need not have unit length: `c_i = r_j × r_k` for the edge
//! opposite to corner i, seen under the angle `θ_i`; the mean vector `m = ½ Σ θ_i c_i/|c_i|`; and `m · c_i / det(r)` is the
//! weight of corner i over its distance. Its numerator is of second order in the height of the point above the plane of the
//! face and in the size of the face, so that it may lose twice, and the sum over all faces three times, the digits that the
//! coordinates themselves lose. 192 bits bear that down to heights of 1e-18.

use crate::cage::{Cage, Face};
use crate::mesh::Point;
use crate::wide::{Vector, Wide, angle, cross, dot};

/// Coordinates of one point.
pub(super) struct Row {
    /// One row of `Φ`: m values.
    pub(super) values: Vec<f64>,
    /// Whether the point lies outside the cage.
    pub(super) outside: bool,
}

/// Height over the size of everything, as a power of two, from which a point lies in the plane of a face.
const IN_PLANE: i32 = -100;
/// Squared sine, as a power of two, from which a point lies in line with an edge.
const IN_LINE: i32 = -280;

/// What an edge with ends at `a` and `b` adds to the mean vectors of its faces.
struct Term {
    /// `a × b`.
    normal: Vector,
    /// `θ / |a × b|`.
    factor: Wide,
}

impl Term {
    /// `None` if the point lies on the edge.
    fn new(a: &Vector, b: &Vector) -> Option<Self> {
        let normal = cross(a, b);
        let (sine2, cosine) = (dot(&normal, &normal), dot(a, b));
        if sine2.is_zero() || sine2.is_below(IN_LINE, cosine * cosine) {
            let beyond = !cosine.is_negative() && !cosine.is_zero();
            return beyond.then(|| Self { normal, factor: cosine.reciprocal() });
        }
        let sine = sine2.sqrt();
        Some(Self { normal, factor: angle(sine, cosine) * sine.reciprocal() })
    }
}

enum Weights {
    /// Twice the weights, over the distances.
    Apart([Wide; 3]),
    /// The point lies on the face: weights up to a common factor.
    On([Wide; 3]),
}

impl Weights {
    fn of_face(signs: [f64; 3], corners: [&Vector; 3], terms: [&Term; 3]) -> Self {
        let signed = |i: usize, x: Wide| if signs[i] < 0.0 { -x } else { x };
        let mut mean = [Wide::ZERO; 3];
        for i in 0..3 {
            let factor = signed(i, terms[i].factor);
            for k in 0..3 {
                mean[k] = mean[k] + factor * terms[i].normal[k];
            }
        }
        let numerators = [0, 1, 2].map(|i| signed(i, dot(&mean, &terms[i].normal)));
        let det = signed(0, dot(corners[0], &terms[0].normal));
        let [a, b, c] = corners.map(|r| r[0].abs() + r[1].abs() + r[2].abs());
        if !det.is_zero() && !det.is_below(IN_PLANE, a * b * c) {
            let inverse = det.reciprocal();
            return Self::Apart(numerators.map(|n| n * inverse));
        }
        // In its plane, a point sees a face under the solid angle 2π or not at all.
        if dot(&mean, &mean).value() > 1.0 { Self::On(numerators) } else { Self::Apart([Wide::ZERO; 3]) }
    }
}

/// Weights of one face over the distances of its corners; `None` if the point lies on the face.
pub(super) fn face_weights(cage: &Cage, face: &Face, x: Point) -> Option<[f64; 3]> {
    let corners = face.vertices.map(|v| difference(cage.vertices()[v as usize], x));
    let mut terms = [None, None, None];
    for i in 0..3 {
        let (a, b) = (&corners[(i + 1) % 3], &corners[(i + 2) % 3]);
        terms[i] = Some(Term::new(a, b)?);
    }
    let [Some(t0), Some(t1), Some(t2)] = &terms else { return None };
    match Weights::of_face([1.0; 3], corners.each_ref(), [t0, t1, t2]) {
        Weights::Apart(weights) => Some(weights.map(|w| w.scaled(-1).value())),
        Weights::On(_) => None,
    }
}

/// Coordinates of a point anywhere.
pub(super) fn row(cage: &Cage, x: Point) -> Row {
    let corners: Vec<Vector> = cage.vertices().iter().map(|&v| difference(v, x)).collect();
    if let Some(vertex) = corners.iter().position(|r| r.iter().all(|c| c.is_zero())) {
        return on_the_cage(cage, &[(vertex, Wide::ONE)]);
    }
    let mut terms = Vec::with_capacity(cage.edges().len());
    for edge in cage.edges() {
        let [a, b] = edge.vertices.map(|v| v as usize);
        let Some(term) = Term::new(&corners[a], &corners[b]) else {
            let [near, far] = [a, b].map(|v| dot(&corners[v], &corners[v]).sqrt());
            return on_the_cage(cage, &[(a, far), (b, near)]);
        };
        terms.push(term);
    }
    let mut weights = vec![Wide::ZERO; corners.len()];
    for face in cage.faces() {
        let vertices = face.vertices.map(|v| v as usize);
        let (ends, sides) = (vertices.map(|v| &corners[v]), face.edges.map(|e| &terms[e as usize]));
        match Weights::of_face(face.signs, ends, sides) {
            Weights::Apart(added) => {
                for (v, w) in vertices.into_iter().zip(added) {
                    weights[v] = weights[v] + w;
                }
            }
            Weights::On(only) => {
                let [v0, v1, v2] = vertices;
                return on_the_cage(cage, &[(v0, only[0]), (v1, only[1]), (v2, only[2])]);
            }
        }
    }
    let (values, total) = normalised(&weights);
    Row { values, outside: total.is_negative() }
}

/// Whether the point lies between the ends of an edge, to within 2⁻⁵⁶ of its length.
pub(super) fn is_on_edge(a: Point, b: Point, x: Point) -> bool {
    let (p, q, edge) = (difference(a, x), difference(b, x), difference(b, a));
    let (normal, length2) = (cross(&p, &q), dot(&edge, &edge));
    // |a × b| is the length of the edge times the distance from it.
    dot(&p, &q).is_negative() && dot(&normal, &normal).is_below(-112, length2 * length2)
}

fn difference(a: Point, b: Point) -> Vector {
    [0, 1, 2].map(|k| Wide::new(a[k]) - Wide::new(b[k]))
}

fn on_the_cage(cage: &Cage, entries: &[(usize, Wide)]) -> Row {
    let mut weights = vec![Wide::ZERO; cage.vertices().len()];
    for &(vertex, weight) in entries {
        weights[vertex] = weight;
    }
    Row { values: normalised(&weights).0, outside: false }
}

fn normalised(weights: &[Wide]) -> (Vec<f64>, Wide) {
    let total = weights.iter().fold(Wide::ZERO, |sum, &w| sum + w);
    let inverse = total.reciprocal();
    (weights.iter().map(|&w| (w * inverse).value()).collect(), total)
}
