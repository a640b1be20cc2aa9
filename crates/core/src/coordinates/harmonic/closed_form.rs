//! Potentials of polynomial densities on a triangle near it, in closed form.
//!
//! With `ρ = y − x'` from the projection `x'` of x, `h` its height and `R = √(ρ² + h²)`, the
//! gradient of R is `ρ/R` and the divergence of `ρ M R` is `2 M R + (ρ·∇M) R + M (R² − h²)/R`. So
//! `I[M] = ∫ M/R` and `J[M] = ∫ M R` of monomials M in α, β follow from lower degrees and from
//! integrals of R along the edges.

use super::basis::{MAX_DEGREE, MAX_FUNCTIONS, functions, place};
use super::quadrature::{GAUSS_6, Tables};
use super::triangle::Triangle;
use crate::coordinates::layer::{INVERSE_4PI, edge_logarithm};
use crate::simd::{LANES, Lanes, angle, dot};
use cager_geometry::mesh::Point;
use cager_geometry::vector;

/// Farther from an edge than so many of its lengths, integrals along it are taken by quadrature.
const FAR_FROM_EDGE: f64 = 1.5;

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
    let l = edge_logarithm(a, b, length).value;
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
            f[k] =
                (rb - start * f[k - 1] * (2.0 * kk - 1.0) - ra2 * f[k - 2] * ((kk - 1.0) * inverse)) * (inverse / kk);
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
pub(super) fn closed_form(
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
        let inner = |a: &Point, b: &Point| vector::dot(*a, *b);
        let (gaa, gab, gbb) = (inner(ga, ga), inner(ga, gb), inner(gb, gb));
        let slopes = |g: &Point| [0, 1, 2].map(|e| inner(g, &triangle.outward[e]));
        let (sa, sb) = (slopes(ga), slopes(gb));
        for d in 1..=degree {
            for b in 0..=d {
                let a = d - b;
                // The factor α or β comes off, and M of one degree less remains.
                let (ma, mb) = if a > 0 { (a - 1, b) } else { (a, b - 1) };
                let m = place(ma, mb);
                let (shift, s, with_a, with_b) = if a > 0 { (alpha, &sa, gaa, gab) } else { (beta, &sb, gab, gbb) };
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
