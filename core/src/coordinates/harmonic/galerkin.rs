//! The discrete equations `∫ b (S q) = ∫ b (½ u − K u)`: Galerkin's method for the first-kind equation of the single layer S, with
//! the double layer K of the cage's hat functions taken exactly.

use super::basis::{MAX_FUNCTIONS, functions};
use super::elements::{Element, Unknowns};
use super::potential::{Tables, potentials};
use super::quadrature::Rule;
use crate::coordinates::layer::{INVERSE_4PI, Layers, group_potentials};
use crate::mesh;
use crate::simd::{LANES, Lanes};
use faer::{Mat, MatRef};
use rayon::prelude::*;

/// Elements nearer than so many sums of their radii are integrated with the dense rule.
const NEAR: f64 = 1.5;
/// Elements farther apart than so many sums of their radii feel each other's low unknowns only.
const APART: f64 = 2.0;

/// Rules for the outer integral, with weighted polynomials at the nodes.
pub(super) struct Outer {
    near: (Rule, Vec<[f64; MAX_FUNCTIONS]>),
    far: (Rule, Vec<[f64; MAX_FUNCTIONS]>),
}

impl Outer {
    pub(super) fn new(tables: &Tables) -> Self {
        let with = |rule: Rule| {
            let values = tables.basis.weighted(&rule);
            (rule, values)
        };
        let q = std::env::var("HQ").is_ok();
        let n = Rule::degree_8().quartered();
        let n = if q { n.quartered() } else { n };
        Self { near: with(n), far: with(Rule::degree_8()) }
    }
}

/// `∫ over the outer element of its polynomials times the potentials of the inner one's`.
fn block(
    tables: &Tables,
    outer_rules: &Outer,
    (outer, outer_degree): (&Element, usize),
    (inner, inner_degree): (&Element, usize),
    out: &mut [[f64; MAX_FUNCTIONS]],
) {
    let (rows, columns) = (functions(outer_degree), functions(inner_degree));
    let apart = mesh::norm([0, 1, 2].map(|k| outer.triangle.centre[k] - inner.triangle.centre[k]));
    let near = apart < NEAR * (outer.triangle.radius + inner.triangle.radius);
    let (rule, values) = if near { &outer_rules.near } else { &outer_rules.far };
    for row in &mut out[..rows] {
        row[..columns].fill(0.0);
    }
    let mut found = [Lanes::ZERO; MAX_FUNCTIONS];
    for (nodes, weighted) in rule.nodes.chunks(LANES).zip(values.chunks(LANES)) {
        let mut x = [Lanes::ZERO; 3];
        for l in 0..LANES {
            let node = nodes[l.min(nodes.len() - 1)];
            let point = outer.triangle.point(node[0], node[1]);
            for k in 0..3 {
                x[k].0[l] = point[k];
            }
        }
        potentials(tables, &inner.triangle, inner_degree, &x, &mut found);
        for (l, weights) in weighted.iter().enumerate() {
            for i in 0..rows {
                let weight = outer.triangle.area * weights[i];
                for j in 0..columns {
                    out[i][j] += weight * found[j].0[l];
                }
            }
        }
    }
}

/// Elements that feel each other's high unknowns.
pub(super) struct NearPairs {
    /// The larger element, the smaller one, and all their entries, in this order.
    pairs: Vec<(u32, u32, Mat<f64>)>,
    /// For each element its pairs, as places in the list.
    around: Vec<Vec<u32>>,
}

impl NearPairs {
    fn new(pairs: Vec<(u32, u32, Mat<f64>)>, elements: usize) -> Self {
        let mut around = vec![Vec::new(); elements];
        for (place, &(a, b, _)) in pairs.iter().enumerate() {
            around[a as usize].push(place as u32);
            if a != b {
                around[b as usize].push(place as u32);
            }
        }
        Self { pairs, around }
    }

    /// The elements near this one, itself among them, each with the entries, whose rows belong to the larger of both, and whether
    /// that is the other one.
    pub(super) fn of(&self, element: usize) -> impl Iterator<Item = (usize, MatRef<'_, f64>, bool)> {
        self.around[element].iter().map(move |&place| {
            let (a, b, entries) = &self.pairs[place as usize];
            let (a, b) = (*a as usize, *b as usize);
            if a == element { (b, entries.as_ref(), false) } else { (a, entries.as_ref(), true) }
        })
    }
}

/// The discrete single layer.
pub(super) struct Operator {
    /// Low unknowns with each other, the lower triangle.
    pub(super) low: Mat<f64>,
    /// Near elements with all their unknowns.
    pub(super) near: NearPairs,
}

/// Whether the high unknowns of two elements feel each other and the other's low ones.
fn is_near(a: &Element, b: &Element) -> bool {
    let apart = mesh::norm([0, 1, 2].map(|k| a.triangle.centre[k] - b.triangle.centre[k]));
    apart < APART * (a.triangle.radius + b.triangle.radius)
}

/// The single layer of all elements.
pub(super) fn operator(tables: &Tables, outer: &Outer, unknowns: &Unknowns) -> Operator {
    let elements = &unknowns.elements;
    let low = unknowns.low;
    let low_degree = (0..).find(|&d| functions(d) == low).unwrap_or(0);
    let mut a = crate::simd::zeros::<f64>(unknowns.low_count(), unknowns.low_count());
    let found: Vec<Vec<(u32, u32, Mat<f64>)>> = a
        .as_mut()
        .par_col_chunks_mut(low)
        .enumerate()
        .map_init(
            || vec![[0.0; MAX_FUNCTIONS]; MAX_FUNCTIONS],
            |out, (j, mut columns)| {
                let column = &elements[j];
                let mut found = Vec::new();
                for (i, row) in elements.iter().enumerate().skip(j) {
                    let near = is_near(row, column);
                    let degrees = if near { [row.degree, column.degree] } else { [low_degree; 2] };
                    // The thinner one outside: the potential of the other varies little across it.
                    let swapped = row.triangle.height() > column.triangle.height();
                    if swapped {
                        block(tables, outer, (column, degrees[1]), (row, degrees[0]), out);
                    } else {
                        block(tables, outer, (row, degrees[0]), (column, degrees[1]), out);
                    }
                    let at = |k: usize, l: usize| {
                        let value = if swapped { out[l][k] } else { out[k][l] };
                        if i == j { 0.5 * (value + out[l][k]) } else { value }
                    };
                    for l in 0..low {
                        for k in 0..low {
                            columns[(i * low + k, l)] = at(k, l);
                        }
                    }
                    if near {
                        let entries = Mat::from_fn(functions(row.degree), functions(column.degree), at);
                        found.push((i as u32, j as u32, entries));
                    }
                }
                found
            },
        )
        .collect();
    Operator { low: a, near: NearPairs::new(found.into_iter().flatten().collect(), elements.len()) }
}

/// Right-hand sides of the low and of the high unknowns, one per vertex of the cage.
pub(super) struct RightHandSides {
    pub(super) low: Mat<f64>,
    pub(super) high: Mat<f64>,
}

/// The right-hand sides, one per vertex of the cage.
pub(super) fn right_hand_sides(outer: &Outer, layers: &Layers, unknowns: &Unknowns) -> RightHandSides {
    let m = layers.vertices().len();
    let (rule, values) = &outer.near;
    let rows: Vec<Mat<f64>> = unknowns
        .elements
        .par_iter()
        .map_init(
            || layers.scratch(),
            |scratch, element| {
                let count = functions(element.degree);
                let mut rows = Mat::zeros(m, count);
                let face = &layers.faces()[element.face as usize];
                for (nodes, weighted) in rule.nodes.chunks(LANES).zip(values.chunks(LANES)) {
                    let mut x = [Lanes::ZERO; 3];
                    for l in 0..LANES {
                        let node = nodes[l.min(nodes.len() - 1)];
                        let point = element.triangle.point(node[0], node[1]);
                        for k in 0..3 {
                            x[k].0[l] = point[k];
                        }
                    }
                    group_potentials(layers, &x, scratch);
                    for (l, weights) in weighted.iter().enumerate() {
                        let at = [0, 1, 2].map(|k| x[k].0[l]);
                        let corner = layers.vertices()[face.vertices[0] as usize];
                        let (hats, _) = face.completion([0, 1, 2].map(|k| at[k] - corner[k]));
                        for k in 0..count {
                            let weight = element.triangle.area * weights[k];
                            let factor = -INVERSE_4PI * weight;
                            for v in 0..m {
                                rows[(v, k)] += factor * scratch.double[v].0[l];
                            }
                            for i in 0..3 {
                                rows[(face.vertices[i] as usize, k)] += 0.5 * weight * hats[i];
                            }
                        }
                    }
                }
                rows
            },
        )
        .collect();
    let mut low = crate::simd::zeros::<f64>(unknowns.low_count(), m);
    let mut high = crate::simd::zeros::<f64>(unknowns.high_count(), m);
    for (e, rows) in rows.iter().enumerate() {
        for v in 0..m {
            for k in 0..unknowns.low {
                low[(e * unknowns.low + k, v)] = rows[(v, k)];
            }
            for (k, place) in unknowns.high(e).enumerate() {
                high[(place, v)] = rows[(v, unknowns.low + k)];
            }
        }
    }
    RightHandSides { low, high }
}
