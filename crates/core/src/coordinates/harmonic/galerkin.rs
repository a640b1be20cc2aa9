//! The discrete equations `∫ b (S q) = ∫ b (½ u − K u)`: Galerkin's method for the first-kind
//! equation of the single layer S, with the double layer K of the cage's hat functions exact.

use super::basis::{MAX_FUNCTIONS, functions};
use super::elements::{Element, Unknowns};
use super::potential::potentials;
use super::quadrature::{Rule, Tables};
use super::triangle::Triangle;
use crate::coordinates::layer::{INVERSE_4PI, Layers, group_potentials};
use crate::simd::{LANES, Lanes, gather, multiversion};
use cager_geometry::vector;
use faer::{Mat, MatRef};
use rayon::prelude::*;

/// Elements nearer than so many sums of their radii are integrated with the dense rule.
const NEAR: f64 = 1.5;
/// Elements of the same height up to this factor are integrated both ways.
const ALIKE: f64 = 1.0 + 1e-9;
/// Elements farther apart than so many sums of their radii feel each other's low unknowns only.
const APART: f64 = 1.5;

/// Rules for the outer integral.
pub(super) struct Outer {
    near: OuterRule,
    far: OuterRule,
}

/// Nodes in groups of eight, filled up with weights of zero, and the weighted polynomials there.
struct OuterRule {
    nodes: Vec<[Lanes; 2]>,
    weighted: Vec<[f64; MAX_FUNCTIONS]>,
}

impl OuterRule {
    fn new(tables: &Tables, rule: &Rule) -> Self {
        let values = rule.weighted(&tables.basis);
        let groups = rule.nodes.len().div_ceil(LANES);
        let mut nodes = vec![[Lanes::splat(1.0 / 3.0); 2]; groups];
        let mut weighted = vec![[0.0; MAX_FUNCTIONS]; LANES * groups];
        for (q, (node, value)) in rule.nodes.iter().zip(&values).enumerate() {
            let (group, l) = (q / LANES, q % LANES);
            for k in 0..2 {
                nodes[group][k].0[l] = node[k];
            }
            weighted[q] = *value;
        }
        Self { nodes, weighted }
    }

    /// The nodes of one group on a triangle.
    fn at(&self, group: usize, triangle: &Triangle) -> [Lanes; 3] {
        let [alpha, beta] = &self.nodes[group];
        gather(|l| triangle.point(alpha.0[l], beta.0[l]))
    }
}

/// Lane groups that hold all polynomials.
const GROUPS: usize = MAX_FUNCTIONS.div_ceil(LANES);

/// Working memory for one pair of elements.
struct BlockScratch {
    /// Potentials by node, and by polynomial in lanes.
    potentials: Vec<[Lanes; GROUPS]>,
    out: Vec<[Lanes; GROUPS]>,
}

multiversion! {
    /// Sums over the nodes of weights times potentials.
    fn contract(weights: &[[f64; MAX_FUNCTIONS]], potentials: &[[Lanes; GROUPS]], out: &mut [[Lanes; GROUPS]]) {
        for (i, row) in out.iter_mut().enumerate() {
            let mut sums = [Lanes::ZERO; GROUPS];
            for (weights, potentials) in weights.iter().zip(potentials) {
                let weight = weights[i];
                for g in 0..GROUPS {
                    sums[g] = sums[g] + potentials[g] * weight;
                }
            }
            *row = sums;
        }
    }
}

impl Outer {
    pub(super) fn new(tables: &Tables) -> Self {
        let dense = Rule::degree_8().quartered();
        Self { near: OuterRule::new(tables, &dense), far: OuterRule::new(tables, &Rule::degree_8()) }
    }
}

/// `∫ over the outer element of its polynomials times the potentials of the inner one's`.
fn block(
    tables: &Tables,
    rules: &Outer,
    (outer, outer_degree): (&Element, usize),
    (inner, inner_degree): (&Element, usize),
    scratch: &mut BlockScratch,
) {
    let (rows, columns) = (functions(outer_degree), functions(inner_degree));
    let apart = vector::norm(vector::sub(outer.triangle.centre, inner.triangle.centre));
    let near = apart < NEAR * (outer.triangle.radius + inner.triangle.radius);
    let rule = if near { &rules.near } else { &rules.far };
    let mut found = [Lanes::ZERO; MAX_FUNCTIONS];
    for (group, here) in scratch.potentials.chunks_exact_mut(LANES).enumerate().take(rule.nodes.len()) {
        let x = rule.at(group, &outer.triangle);
        potentials(tables, &inner.triangle, inner_degree, &x, &mut found);
        for (j, found) in found[..columns].iter().enumerate() {
            for l in 0..LANES {
                here[l][j / LANES].0[j % LANES] = outer.triangle.area * found.0[l];
            }
        }
    }
    contract(&rule.weighted, &scratch.potentials, &mut scratch.out[..rows]);
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

    /// The elements near this one, itself included, with entries: its rows × the other's columns.
    pub(super) fn of(&self, element: usize) -> impl Iterator<Item = (usize, MatRef<'_, f64>)> {
        self.around[element].iter().map(move |&place| {
            let (a, b, entries) = &self.pairs[place as usize];
            let (a, b) = (*a as usize, *b as usize);
            if a == element { (b, entries.as_ref()) } else { (a, entries.transpose()) }
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
pub(super) fn is_near(a: &Element, b: &Element) -> bool {
    let apart = vector::norm(vector::sub(a.triangle.centre, b.triangle.centre));
    apart < APART * (a.triangle.radius + b.triangle.radius)
}

/// The single layer of all elements.
pub(super) fn operator(tables: &Tables, outer: &Outer, unknowns: &Unknowns) -> Operator {
    let elements = &unknowns.elements;
    let low = unknowns.low;
    let mut a = cager_geometry::linalg::zeros::<f64>(unknowns.low_count(), unknowns.low_count());
    let found: Vec<Vec<(u32, u32, Mat<f64>)>> = a
        .as_mut()
        .par_col_chunks_mut(low)
        .enumerate()
        .map_init(
            || {
                [0, 1].map(|_| BlockScratch {
                    potentials: vec![[Lanes::ZERO; GROUPS]; LANES * outer.near.nodes.len()],
                    out: vec![[Lanes::ZERO; GROUPS]; MAX_FUNCTIONS],
                })
            },
            |scratch, (j, mut columns)| {
                let column = &elements[j];
                let mut found = Vec::new();
                for (i, row) in elements.iter().enumerate().skip(j) {
                    let near = is_near(row, column);
                    let degrees = if near { [row.degree, column.degree] } else { [unknowns.low_degree; 2] };
                    // The thinner one outside: the potential of the other varies little across it.
                    let (mine, theirs) = (row.triangle.height(), column.triangle.height());
                    let outwards = [mine <= ALIKE * theirs, theirs <= ALIKE * mine];
                    if outwards[0] {
                        block(tables, outer, (row, degrees[0]), (column, degrees[1]), &mut scratch[0]);
                    }
                    if outwards[1] {
                        block(tables, outer, (column, degrees[1]), (row, degrees[0]), &mut scratch[1]);
                    }
                    let of = |which: usize, k: usize, l: usize| scratch[which].out[k][l / LANES].0[l % LANES];
                    let at = |k: usize, l: usize| match outwards {
                        [true, false] => of(0, k, l),
                        [false, true] => of(1, l, k),
                        _ => 0.5 * (of(0, k, l) + of(1, l, k)),
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
    let rule = &outer.near;
    let nodes = LANES * rule.nodes.len();
    let rows: Vec<Mat<f64>> = unknowns
        .elements
        .par_iter()
        .map_init(
            || (layers.scratch(), Mat::<f64>::zeros(nodes, m)),
            |(scratch, data), element| {
                let face = &layers.faces()[element.face as usize];
                let corner = layers.vertices()[face.vertices[0] as usize];
                for group in 0..rule.nodes.len() {
                    let x = rule.at(group, &element.triangle);
                    group_potentials(layers, &x, scratch);
                    let here = LANES * group..LANES * (group + 1);
                    for v in 0..m {
                        let value = scratch.double[v] * -INVERSE_4PI;
                        data.col_as_slice_mut(v)[here.clone()].copy_from_slice(&value.0);
                    }
                    for (l, q) in here.enumerate() {
                        let (hats, _) = face.affine_coordinates([0, 1, 2].map(|k| x[k].0[l] - corner[k]));
                        for i in 0..3 {
                            data[(q, face.vertices[i] as usize)] += 0.5 * hats[i];
                        }
                    }
                }
                let count = functions(element.degree);
                let weights = Mat::from_fn(count, nodes, |k, q| element.triangle.area * rule.weighted[q][k]);
                cager_geometry::linalg::product(weights.as_ref(), data.as_ref())
            },
        )
        .collect();
    let mut low = cager_geometry::linalg::zeros::<f64>(unknowns.low_count(), m);
    let mut high = cager_geometry::linalg::zeros::<f64>(unknowns.high_count(), m);
    for (e, rows) in rows.iter().enumerate() {
        for v in 0..m {
            for k in 0..unknowns.low {
                low[(e * unknowns.low + k, v)] = rows[(k, v)];
            }
            for (k, place) in unknowns.high(e).enumerate() {
                high[(place, v)] = rows[(unknowns.low + k, v)];
            }
        }
    }
    RightHandSides { low, high }
}
