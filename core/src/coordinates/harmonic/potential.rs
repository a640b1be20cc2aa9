//! Potentials of polynomial densities on a triangle, `∫ q(y) / 4π|x − y| dy`, for eight points at a time.
//!
//! Near the triangle in closed form. With `ρ = y − x'` from the projection `x'` of x, `h` its height and `R = √(ρ² + h²)`, the gradient
//! of R is `ρ/R` and the divergence of `ρ M R` is `2 M R + (ρ·∇M) R + M (R² − h²)/R`. So the integrals `I[M] = ∫ M/R` and
//! `J[M] = ∫ M R` of monomials M in the barycentric coordinates α, β follow from those of lower degree and from integrals of R along the
//! edges. Far away by quadrature.

use super::basis::{Basis, MAX_DEGREE, MAX_FUNCTIONS, functions, place};
use super::quadrature::{GAUSS_6, Rule};
use crate::mesh::{self, Point};
use crate::simd::{LANES, Lanes, angle, dot, ln_ratio, multiversion};

/// Largest ratio whose logarithm is taken, at edges.
const LARGEST: f64 = 1.329_227_995_784_916e36;
/// Farther from an edge than so many of its lengths, integrals along it are taken by quadrature.
const FAR_FROM_EDGE: f64 = 1.5;
/// Farther from the centre than so many radii, a triangle's potentials are taken by quadrature,
const FAR: f64 = 6.0;
/// and here with fewer points and degrees.
const FARTHER: f64 = 20.0;
/// Degree of the densities that are felt there.
const FARTHER_DEGREE: usize = 2;

/// A triangle with a polynomial density.
#[derive(Clone, Debug)]
pub(super) struct Triangle {
    pub(super) corners: [Point; 3],
    pub(super) centre: Point,
    /// Largest distance of a corner from the centre.
    pub(super) radius: f64,
    pub(super) area: f64,
    normal: Point,
    /// Gradients of α and β.
    gradients: [Point; 2],
    /// Along the edges from corner 0 to 1, 1 to 2 and 0 to 2, their outward normals, and lengths.
    along: [Point; 3],
    outward: [Point; 3],
    lengths: [f64; 3],
}

fn minus(a: Point, b: Point) -> Point {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

impl Triangle {
    pub(super) fn new(corners: [Point; 3]) -> Self {
        let [a, b, c] = corners;
        let normal = mesh::cross(minus(b, a), minus(c, a));
        let double_area = mesh::norm(normal);
        let normal = normal.map(|x| x / double_area);
        let centre = [0, 1, 2].map(|k| (a[k] + b[k] + c[k]) / 3.0);
        let radius = corners.iter().map(|&p| mesh::norm(minus(p, centre))).fold(0.0, f64::max);
        let sides = [minus(b, a), minus(c, b), minus(c, a)];
        let lengths = sides.map(mesh::norm);
        let along = [0, 1, 2].map(|e| sides[e].map(|x| x / lengths[e]));
        let outward = [
            mesh::cross(along[0], normal),
            mesh::cross(along[1], normal),
            mesh::cross(along[2], normal).map(|x| -x),
        ];
        let gradient = |opposite: Point| mesh::cross(normal, opposite).map(|x| x / double_area);
        let gradients = [gradient(minus(a, c)), gradient(minus(b, a))];
        Self { corners, centre, radius, area: 0.5 * double_area, normal, gradients, along, outward, lengths }
    }

    /// The point with these barycentric coordinates.
    pub(super) fn point(&self, alpha: f64, beta: f64) -> Point {
        let [a, b, c] = self.corners;
        [0, 1, 2].map(|k| a[k] + alpha * (b[k] - a[k]) + beta * (c[k] - a[k]))
    }

    /// Height over the longest side.
    pub(super) fn height(&self) -> f64 {
        2.0 * self.area / self.diameter()
    }

    /// Length of the longest side.
    pub(super) fn diameter(&self) -> f64 {
        self.lengths.iter().copied().fold(0.0, f64::max)
    }
}

/// What the potentials of all triangles need.
pub(super) struct Tables {
    pub(super) basis: Basis,
    /// Rules with the polynomials at their nodes, times the weights.
    pub(super) fine: (Rule, Vec<[f64; MAX_FUNCTIONS]>),
    pub(super) coarse: (Rule, Vec<[f64; MAX_FUNCTIONS]>),
}

impl Tables {
    pub(super) fn new() -> Self {
        let basis = Basis::new();
        let with = |rule: Rule| {
            let values = basis.weighted(&rule);
            (rule, values)
        };
        Self { fine: with(Rule::degree_8()), coarse: with(Rule::degree_5()), basis }
    }
}

multiversion! {
    /// Potentials at one lane group of the polynomials up to a degree on a triangle; as many entries of `out` are written.
    pub(super) fn potentials(tables: &Tables, triangle: &Triangle, degree: usize, x: &[Lanes; 3], out: &mut [Lanes; MAX_FUNCTIONS])
        = potentials_generic;
}

const INVERSE_4PI: f64 = 1.0 / (4.0 * std::f64::consts::PI);

#[inline(always)]
fn potentials_generic(
    tables: &Tables,
    triangle: &Triangle,
    degree: usize,
    x: &[Lanes; 3],
    out: &mut [Lanes; MAX_FUNCTIONS],
) {
    let c = &triangle.centre;
    let r = [x[0] - Lanes::splat(c[0]), x[1] - Lanes::splat(c[1]), x[2] - Lanes::splat(c[2])];
    let distance2 = dot(&r, &r);
    let at = |radii: f64| (radii * triangle.radius) * (radii * triangle.radius);
    let (far, farther) = (at(FAR), at(FARTHER));
    let count = functions(degree);
    let (mut near_any, mut far_any, mut farther_any) = (false, false, false);
    for l in 0..LANES {
        let d = distance2.0[l];
        near_any |= d <= far;
        far_any |= (d > far) & (d <= farther);
        farther_any |= d > farther;
    }
    if near_any & !far_any & !farther_any {
        closed_form(tables, triangle, degree, x, out);
        return;
    }
    for value in &mut out[..count] {
        *value = Lanes::ZERO;
    }
    let mut part = [Lanes::ZERO; MAX_FUNCTIONS];
    if farther_any {
        let low = degree.min(FARTHER_DEGREE);
        quadrature(triangle, &tables.coarse, low, x, &mut part);
        let keep = distance2.map(|d| if d > farther { 1.0 } else { 0.0 });
        for k in 0..functions(low) {
            out[k] = part[k] * keep;
        }
    }
    if far_any {
        quadrature(triangle, &tables.fine, degree, x, &mut part);
        let keep = distance2.map(|d| if (d > far) & (d <= farther) { 1.0 } else { 0.0 });
        for k in 0..count {
            out[k] = out[k] + part[k] * keep;
        }
    }
    if near_any {
        closed_form(tables, triangle, degree, x, &mut part);
        for k in 0..count {
            for l in 0..LANES {
                if distance2.0[l] <= far {
                    out[k].0[l] = part[k].0[l];
                }
            }
        }
    }
}

#[inline(always)]
fn quadrature(
    triangle: &Triangle,
    (rule, values): &(Rule, Vec<[f64; MAX_FUNCTIONS]>),
    degree: usize,
    x: &[Lanes; 3],
    out: &mut [Lanes; MAX_FUNCTIONS],
) {
    let count = functions(degree);
    for value in &mut out[..count] {
        *value = Lanes::ZERO;
    }
    let scale = INVERSE_4PI * triangle.area;
    for (node, weighted) in rule.nodes.iter().zip(values) {
        let y = triangle.point(node[0], node[1]);
        let r = [x[0] - Lanes::splat(y[0]), x[1] - Lanes::splat(y[1]), x[2] - Lanes::splat(y[2])];
        let inverse = dot(&r, &r).sqrt().map(|d| scale / d);
        for k in 0..count {
            out[k] = out[k] + inverse * weighted[k];
        }
    }
}

/// `∫ τᵏ R ds` along an edge from `τ = 0` to 1 for k up to the degree.
struct EdgeIntegrals {
    powers: [Lanes; MAX_DEGREE],
    /// `∫ ds/R`.
    l: Lanes,
    /// Signed distance of the projection from the edge, positive inside.
    distance: Lanes,
}

#[inline(always)]
fn edge_integrals(
    degree: usize,
    length: f64,
    along: &Point,
    outward: &Point,
    [a, b]: [&[Lanes; 4]; 2],
    height2: Lanes,
) -> EdgeIntegrals {
    let across = a[0] * outward[0] + a[1] * outward[1] + a[2] * outward[2];
    let start = a[0] * along[0] + a[1] * along[1] + a[2] * along[2];
    let [ra, rb] = [a[3], b[3]];
    let far = ra + rb;
    let c = [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
    let cosine = a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    let product = ra * rb;
    let sum = far + Lanes::splat(length);
    let between = cosine.map(|c| if c < 0.0 { 1.0 } else { 0.0 });
    let top = sum * sum * (between * (product - cosine) + between.map(|b| 1.0 - b));
    let bottom = (between * dot(&c, &c) + between.map(|b| 1.0 - b) * (product + cosine)) * 2.0;
    let least = top * (1.0 / LARGEST);
    let bottom = bottom.zip(least, |a, b| if a < b { b } else { a });
    let l = ln_ratio(top, bottom, Lanes::splat(length) / far);
    let mut powers = [Lanes::ZERO; MAX_DEGREE];
    if degree == 0 {
        return EdgeIntegrals { powers, l, distance: across };
    }
    // Squared distance from the middle, against which the recurrence loses digits.
    let limit = (FAR_FROM_EDGE + 0.5) * length;
    let middle = start + Lanes::splat(0.5 * length);
    let beside2 = across * across + height2;
    let off2 = middle * middle + beside2;
    let (mut near_any, mut far_any) = (false, false);
    for lane in 0..LANES {
        near_any |= off2.0[lane] <= limit * limit;
        far_any |= off2.0[lane] > limit * limit;
    }
    if near_any {
        // f[k] = ∫ τᵏ/R ds.
        let mut f = [Lanes::ZERO; MAX_DEGREE + 2];
        let inverse = 1.0 / length;
        let ra2 = ra * ra;
        f[0] = l;
        f[1] = (rb - ra - start * l) * inverse;
        for k in 2..degree + 2 {
            let kk = k as f64;
            f[k] = (rb - start * f[k - 1] * (2.0 * kk - 1.0) - ra2 * f[k - 2] * ((kk - 1.0) * inverse)) * (inverse / kk);
        }
        for k in 0..degree {
            powers[k] = ra2 * f[k] + start * f[k + 1] * (2.0 * length) + f[k + 2] * (length * length);
        }
    }
    if far_any {
        let mut sums = [Lanes::ZERO; MAX_DEGREE];
        for [t, w] in GAUSS_6 {
            let s = start + Lanes::splat(t * length);
            let mut term = (s * s + beside2).sqrt() * (w * length);
            for sum in &mut sums[..degree] {
                *sum = *sum + term;
                term = term * t;
            }
        }
        for k in 0..degree {
            for lane in 0..LANES {
                if off2.0[lane] > limit * limit {
                    powers[k].0[lane] = sums[k].0[lane];
                }
            }
        }
    }
    EdgeIntegrals { powers, l, distance: across }
}

#[inline(always)]
fn closed_form(
    tables: &Tables,
    triangle: &Triangle,
    degree: usize,
    x: &[Lanes; 3],
    out: &mut [Lanes; MAX_FUNCTIONS],
) {
    let mut corners = [[Lanes::ZERO; 4]; 3];
    for (corner, v) in corners.iter_mut().zip(&triangle.corners) {
        let r = [Lanes::splat(v[0]) - x[0], Lanes::splat(v[1]) - x[1], Lanes::splat(v[2]) - x[2]];
        corner[3] = dot(&r, &r).sqrt();
        corner[0] = r[0];
        corner[1] = r[1];
        corner[2] = r[2];
    }
    let along = |r: &[Lanes; 4], axis: &Point| r[0] * axis[0] + r[1] * axis[1] + r[2] * axis[2];
    let [c0, c1, c2] = &corners;
    let height = along(c0, &triangle.normal);
    let height2 = height * height;
    // Written out: the closure of a map over them would be compiled for any machine.
    let Triangle { lengths, along: ways, outward, .. } = triangle;
    let e0 = edge_integrals(degree, lengths[0], &ways[0], &outward[0], [c0, c1], height2);
    let e1 = edge_integrals(degree, lengths[1], &ways[1], &outward[1], [c1, c2], height2);
    let e2 = edge_integrals(degree, lengths[2], &ways[2], &outward[2], [c0, c2], height2);
    let products = |a: &[Lanes; 4], b: &[Lanes; 4]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    let size = height.map(f64::abs);
    let sine = size * (2.0 * triangle.area);
    let cosine = c0[3] * c1[3] * c2[3] + products(c0, c1) * c2[3] + products(c1, c2) * c0[3] + products(c2, c0) * c1[3];
    let omega = angle(sine, cosine) * 2.0;
    // I and J of all monomials.
    let mut i = [Lanes::ZERO; MAX_FUNCTIONS];
    let mut j = [Lanes::ZERO; MAX_FUNCTIONS];
    i[0] = e0.distance * e0.l + e1.distance * e1.l + e2.distance * e2.l - size * omega;
    if degree > 0 {
        // On the edge from corner 1 to 2: mixed[a][b] = ∫ (1 − τ)ᵃ τᵇ R.
        let mut mixed = [[Lanes::ZERO; MAX_DEGREE]; MAX_DEGREE];
        mixed[0] = e1.powers;
        for a in 1..degree {
            for b in 0..degree - a {
                mixed[a][b] = mixed[a - 1][b] - mixed[a - 1][b + 1];
            }
        }
        let [ga, gb] = &triangle.gradients;
        let alpha = along(c0, ga) * -1.0;
        let beta = along(c0, gb) * -1.0;
        let inner = |a: &Point, b: &Point| mesh::dot(*a, *b);
        let (gaa, gab, gbb) = (inner(ga, ga), inner(ga, gb), inner(gb, gb));
        let slopes = |g: &Point| [0, 1, 2].map(|e| inner(g, &triangle.outward[e]));
        let (sa, sb) = (slopes(ga), slopes(gb));
        for d in 1..=degree {
            for b in 0..=d {
                let a = d - b;
                // The factor α or β comes off, and M of one degree less remains.
                let (ma, mb) = if a > 0 { (a - 1, b) } else { (a, b - 1) };
                let m = place(ma, mb);
                let (shift, s, with_a, with_b) =
                    if a > 0 { (alpha, &sa, gaa, gab) } else { (beta, &sb, gab, gbb) };
                let mut value = shift * i[m] + mixed[ma][mb] * s[1];
                if mb == 0 {
                    value = value + e0.powers[ma] * s[0];
                }
                if ma == 0 {
                    value = value + e2.powers[mb] * s[2];
                }
                if ma > 0 {
                    value = value - j[place(ma - 1, mb)] * (ma as f64 * with_a);
                }
                if mb > 0 {
                    value = value - j[place(ma, mb - 1)] * (mb as f64 * with_b);
                }
                i[place(a, b)] = value;
            }
            // J of degree d − 1.
            for b in 0..d {
                let a = d - 1 - b;
                let m = place(a, b);
                let mut value = height2 * i[m] + e1.distance * mixed[a][b];
                if b == 0 {
                    value = value + e0.distance * e0.powers[a];
                } else {
                    value = value + beta * j[place(a, b - 1)] * b as f64;
                }
                if a == 0 {
                    value = value + e2.distance * e2.powers[b];
                } else {
                    value = value + alpha * j[place(a - 1, b)] * a as f64;
                }
                j[m] = value * (1.0 / (d as f64 + 2.0));
            }
        }
    }
    for k in 0..functions(degree) {
        let mut value = Lanes::ZERO;
        for (m, &c) in tables.basis.coefficients[k][..=k].iter().enumerate() {
            value = value + i[m] * c;
        }
        out[k] = value * INVERSE_4PI;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The same by brute force: the triangle divided until its parts are small against their distance.
    fn divided(tables: &Tables, whole: &Triangle, at: [[f64; 2]; 3], degree: usize, x: Point, out: &mut [f64], depth: usize) {
        let part = Triangle::new(at.map(|p| whole.point(p[0], p[1])));
        if depth < 40 && mesh::norm(minus(part.centre, x)) < 8.0 * part.radius {
            let middle = |p: [f64; 2], q: [f64; 2]| [0.5 * (p[0] + q[0]), 0.5 * (p[1] + q[1])];
            let [a, b, c] = at;
            let (d, e, f) = (middle(a, b), middle(b, c), middle(c, a));
            for at in [[a, d, f], [d, b, e], [f, e, c], [d, e, f]] {
                divided(tables, whole, at, degree, x, out, depth + 1);
            }
            return;
        }
        let mut values = [0.0; MAX_FUNCTIONS];
        for node in &Rule::degree_8().nodes {
            let [a, b, c] = at;
            let p = [0, 1].map(|k| a[k] + node[0] * (b[k] - a[k]) + node[1] * (c[k] - a[k]));
            tables.basis.values(p, &mut values[..functions(degree)]);
            let weight = INVERSE_4PI * part.area * node[2] / mesh::norm(minus(whole.point(p[0], p[1]), x));
            for k in 0..functions(degree) {
                out[k] += weight * values[k];
            }
        }
    }

    #[test]
    fn closed_form_and_quadrature_are_what_division_gives() {
        let tables = Tables::new();
        for corners in [
            [[0.0, 0.0, 0.0], [1.0, 0.1, 0.0], [0.2, 0.9, 0.3]],
            [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.98, 0.03, 0.0]],
            [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.5, 0.02, 0.01]],
        ] {
            let triangle = Triangle::new(corners);
            for (alpha, beta, height) in [
                (0.3, 0.3, 0.2),
                (0.3, 0.3, 1e-3),
                (0.5, 0.0, 1e-3),
                (0.5, 0.5, 1e-2),
                (0.0, 0.0, 1e-2),
                (1.5, 0.2, 0.0),
                (-0.7, 0.9, 0.4),
                (2.0, 2.0, 1.0),
                (3.5, 0.5, 0.5),
                (0.2, 0.2, 5.0),
                (0.2, 0.2, 12.0),
            ] {
                let on = triangle.point(alpha, beta);
                let x = [0, 1, 2].map(|k| on[k] + height * triangle.normal[k]);
                let mut exact = [0.0; MAX_FUNCTIONS];
                let unit = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]];
                divided(&tables, &triangle, unit, MAX_DEGREE, x, &mut exact, 0);
                let mut found = [Lanes::ZERO; MAX_FUNCTIONS];
                potentials(&tables, &triangle, MAX_DEGREE, &x.map(Lanes::splat), &mut found);
                for k in 0..MAX_FUNCTIONS {
                    let error = (found[k].0[0] - exact[k]).abs() / exact[0];
                    assert!(error < 5e-6, "{corners:?} ({alpha}, {beta}, {height}) polynomial {k}: {} for {} ({error:e})", found[k].0[0], exact[k]);
                }
            }
        }
    }
}
