//! Potentials `∫ q(y) / 4π|x − y| dy` of polynomial densities on a triangle, for eight points at a
//! time: near it in closed form, farther away by quadrature.

use super::basis::{MAX_FUNCTIONS, functions};
use super::closed_form::closed_form;
use super::quadrature::{Rule, Tables};
use super::triangle::Triangle;
use crate::coordinates::layer::INVERSE_4PI;
use crate::simd::{LANES, Lanes, dot, multiversion};

/// From so many radii from the centre on, a triangle's potentials are taken by quadrature.
const QUADRATURE_FROM: f64 = 6.0;
/// From so many on, with fewer points and degrees.
const COARSE_FROM: f64 = 20.0;
/// Degree of the densities that count there.
const COARSE_DEGREE: usize = 2;

multiversion! {
    /// Potentials at one lane group of the polynomials up to a degree, written to `out`.
    pub(super) fn potentials(
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
        let (far, farther) = (at(QUADRATURE_FROM), at(COARSE_FROM));
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
            let low = degree.min(COARSE_DEGREE);
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

#[cfg(test)]
mod tests {
    use super::super::basis::MAX_DEGREE;
    use super::*;
    use cager_geometry::mesh::Point;
    use cager_geometry::vector;

    /// The same by brute force: the triangle divided until its parts are small against their
    /// distance.
    fn divided(
        tables: &Tables,
        whole: &Triangle,
        at: [[f64; 2]; 3],
        degree: usize,
        x: Point,
        out: &mut [f64],
        depth: usize,
    ) {
        let part = Triangle::new(at.map(|p| whole.point(p[0], p[1])));
        if depth < 40 && vector::norm(vector::sub(part.centre, x)) < 8.0 * part.radius {
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
            let weight = INVERSE_4PI * part.area * node[2] / vector::norm(vector::sub(whole.point(p[0], p[1]), x));
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
                let x = vector::along(on, height, triangle.normal);
                let mut exact = [0.0; MAX_FUNCTIONS];
                let unit = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]];
                divided(&tables, &triangle, unit, MAX_DEGREE, x, &mut exact, 0);
                let mut found = [Lanes::ZERO; MAX_FUNCTIONS];
                potentials(&tables, &triangle, MAX_DEGREE, &x.map(Lanes::splat), &mut found);
                // Thin elements are given no higher degree than three.
                let highest = if triangle.diameter() < 4.0 * triangle.height() { MAX_DEGREE } else { 3 };
                for k in 0..functions(highest) {
                    let error = (found[k].0[0] - exact[k]).abs() / exact[0];
                    assert!(
                        error < 2e-5,
                        "{corners:?} ({alpha}, {beta}, {height}) polynomial {k}: {} for {} ({error:e})",
                        found[k].0[0],
                        exact[k]
                    );
                }
            }
        }
    }
}
