//! Rows of `Φ` from the densities.
//!
//! Very near the surface the densities' finite degree shows. The values on the surface are the hat
//! functions: the error at the nearest place there is subtracted, as far as it reaches into the
//! cage, so that values are exact on the surface and continuous near it.

use super::affine::AffineFit;
use super::basis::{MAX_FUNCTIONS, functions};
use super::elements::Unknowns;
use super::near::{Group, Near};
use super::potential::potentials;
use super::quadrature::Tables;
use super::solve::{Part, Solved};
use super::surface::{ClosestPoint, Surface};
use crate::coordinates::layer::{self, INVERSE_4PI, Layers, group_potentials};
use crate::simd::{LANES, Lanes, multiversion, store};
use cager_geometry::linalg;
use cager_geometry::mesh::Point;
use faer::linalg::matmul::matmul;
use faer::{Accum, Mat, MatMut, MatRef, Par};
use rayon::prelude::*;

/// Points that one task computes: some lane groups, which share one product with the low densities.
const TASK_POINTS: usize = 16 * LANES;
/// High unknowns count up to this many radii from their element's centre.
const HIGH_RANGE: f64 = 4.0;
/// Elements with at least this fraction of the largest share of a change are marked.
const MIN_MARKED_SHARE: f64 = 0.3;

/// Densities on the surface, from which coordinates are evaluated.
pub(super) struct Solution<'a> {
    pub(super) tables: &'a Tables,
    pub(super) layers: &'a Layers,
    pub(super) surface: &'a Surface<'a>,
    pub(super) affine: &'a AffineFit,
    pub(super) unknowns: &'a Unknowns,
    pub(super) densities: &'a Solved,
}

/// Coordinates, and how far they are from final.
pub(super) struct Evaluated {
    pub(super) phi: Mat<f64>,
    /// Largest change of an entry by the highest degrees; 0 where it was not requested.
    pub(super) change: f64,
    /// Elements that changes above the tolerance mostly come from.
    pub(super) marked: Vec<bool>,
    /// Largest correction of an entry that makes the rows reproduce linear functions.
    pub(super) correction: f64,
}

/// Result of one task besides its rows.
#[derive(Default)]
struct TaskResult {
    change: f64,
    marked: Vec<u32>,
    correction: f64,
}

/// Working memory of one task.
struct Scratch {
    layers: layer::Scratch,
    /// Single layers of the low polynomials, points × unknowns, times the densities.
    singles: Mat<f32>,
    products: Mat<f32>,
    /// Hat functions' double layers and high densities, and changes, of one lane group by vertex.
    values: Vec<Lanes>,
    change: Vec<Lanes>,
}

/// `Φ` at these points, in the unit of the layers.
pub(super) fn evaluate(
    solution: &Solution<'_>,
    points: &[Point],
    closest_points: &[ClosestPoint],
    tolerance: f64,
) -> Evaluated {
    let m = solution.layers.vertices().len();
    let near = Near::new(solution.surface, solution.unknowns, points, closest_points);
    let low = linalg::to_single(solution.densities.low.as_ref(), solution.densities.low.nrows());
    let mut phi = linalg::zeros::<f64>(points.len(), m);
    let found: Vec<TaskResult> = phi
        .as_mut()
        .par_row_chunks_mut(TASK_POINTS)
        .enumerate()
        .map_init(
            || Scratch {
                layers: solution.layers.scratch(),
                singles: Mat::zeros(TASK_POINTS, solution.unknowns.low_count()),
                products: Mat::zeros(TASK_POINTS, m),
                values: vec![Lanes::ZERO; m],
                change: vec![Lanes::ZERO; m],
            },
            |scratch, (task, rows)| {
                evaluate_task(solution, low.as_ref(), &near, task * TASK_POINTS, tolerance, rows, scratch)
            },
        )
        .collect();
    let mut all =
        Evaluated { phi, change: 0.0, marked: vec![false; solution.unknowns.elements.len()], correction: 0.0 };
    for found in found {
        all.change = all.change.max(found.change);
        // NaN stays.
        all.correction = if found.correction <= all.correction { all.correction } else { found.correction };
        for e in found.marked {
            all.marked[e as usize] = true;
        }
    }
    all
}

fn evaluate_task(
    solution: &Solution<'_>,
    low: MatRef<'_, f32>,
    near: &Near<'_>,
    first: usize,
    tolerance: f64,
    mut rows: MatMut<'_, f64>,
    scratch: &mut Scratch,
) -> TaskResult {
    let layers = solution.layers;
    let count = rows.nrows();
    let mut found = TaskResult::default();
    for start in (0..count).step_by(LANES) {
        let group = near.group(first + start);
        evaluate_group(solution, &group, start, scratch);
        let filled = LANES.min(count - start);
        for (l, i) in (first + start..first + start + filled).enumerate() {
            let closest = &near.closest_points[i];
            for (&v, weight) in layers.triangles()[closest.face as usize].iter().zip(closest.weights) {
                scratch.values[v as usize].0[l] += near.shares[i] * weight;
            }
        }
        store(rows.as_mut(), start, scratch.values.iter().map(|value| value.0));
        let largest =
            scratch.change.iter().fold(Lanes::ZERO, |a, c| a.zip(*c, |a, c| if c.abs() > a { c.abs() } else { a }));
        for l in 0..filled {
            found.change = found.change.max(largest.0[l]);
            if largest.0[l] > tolerance {
                // More than one where the cage is symmetric.
                let worst = |v: &usize| scratch.change[*v].0[l].abs() > (1.0 - 1e-6) * largest.0[l];
                for vertex in (0..scratch.change.len()).filter(worst) {
                    mark(solution, &group, l, vertex as u32, &mut found.marked);
                }
            }
        }
    }
    // Densities are right to some 1e-3: single precision is enough.
    let mut products = scratch.products.as_mut().subrows_mut(0, count);
    matmul(products.as_mut(), Accum::Replace, scratch.singles.as_ref().subrows(0, count), low, 1.0, Par::Seq);
    for (row, product) in rows.as_mut().col_iter_mut().zip(products.col_iter()) {
        faer::zip!(row, product).for_each(|faer::unzip!(row, product)| *row += f64::from(*product));
    }
    found.correction = solution.affine.complete(rows, near.points[first..first + count].iter().copied());
    found
}

/// Values and changes of one lane group, and its rows of the single layers.
fn evaluate_group(solution: &Solution<'_>, group: &Group, start: usize, scratch: &mut Scratch) {
    let Solution { tables, layers, unknowns, densities, .. } = solution;
    let Group { x, y, share, off_surface } = group;
    let twice = share.0.iter().any(|s| *s > 0.0);
    group_potentials(layers, x, &mut scratch.layers);
    for (value, double) in scratch.values.iter_mut().zip(&scratch.layers.double) {
        *value = weigh(*double, *off_surface) * INVERSE_4PI;
    }
    if twice {
        group_potentials(layers, y, &mut scratch.layers);
        for (value, double) in scratch.values.iter_mut().zip(&scratch.layers.double) {
            *value = *value - weigh(*double, *share) * INVERSE_4PI;
        }
    }
    scratch.change.fill(Lanes::ZERO);
    let low_degree = unknowns.low_degree;
    let mut values = [Lanes::ZERO; MAX_FUNCTIONS];
    for (e, element) in unknowns.elements.iter().enumerate() {
        let part = &densities.parts[e];
        let keep = is_within(&element.triangle.centre, HIGH_RANGE * element.triangle.radius, x);
        let near = !part.vertices.is_empty() && keep.0.iter().any(|k| *k > 0.0);
        let degree = if near { element.degree } else { low_degree };
        potentials(tables, &element.triangle, degree, x, &mut values);
        for value in &mut values[..functions(degree)] {
            *value = weigh(*value, *off_surface);
        }
        if twice {
            let mut others = [Lanes::ZERO; MAX_FUNCTIONS];
            potentials(tables, &element.triangle, degree, y, &mut others);
            for (value, other) in values[..functions(degree)].iter_mut().zip(&others) {
                *value = *value - weigh(*other, *share);
            }
        }
        for k in 0..unknowns.low {
            // Rows beyond the last point are there, and not used.
            let column = &mut scratch.singles.col_as_slice_mut(e * unknowns.low + k)[start..start + LANES];
            column.iter_mut().zip(&values[k].0).for_each(|(single, value)| *single = *value as f32);
        }
        if near {
            for value in &mut values[unknowns.low..functions(degree)] {
                *value = *value * keep;
            }
        }
        add_part(
            part,
            functions(element.degree),
            unknowns.low,
            near,
            &values,
            &mut scratch.values,
            &mut scratch.change,
        );
    }
}

/// A value times a factor; zero where the factor is, even if the value is not finite, as on edges.
#[inline(always)]
fn weigh(value: Lanes, by: Lanes) -> Lanes {
    value.zip(by, |value, by| if by == 0.0 { 0.0 } else { value * by })
}

/// One where a point is nearer than the limit.
#[inline(always)]
fn is_within(centre: &Point, limit: f64, x: &[Lanes; 3]) -> Lanes {
    let r = [x[0] - Lanes::splat(centre[0]), x[1] - Lanes::splat(centre[1]), x[2] - Lanes::splat(centre[2])];
    crate::simd::dot(&r, &r).map(|d| if d < limit * limit { 1.0 } else { 0.0 })
}

multiversion! {
    /// Adds the changes of one element, and its high densities if the points are near.
    fn add_part(
        part: &Part,
        all: usize,
        low: usize,
        near: bool,
        potentials: &[Lanes; MAX_FUNCTIONS],
        values: &mut [Lanes],
        change: &mut [Lanes],
    ) {
        let used = if near { all } else { low };
        for (c, &v) in part.vertices.iter().enumerate() {
            if !part.change.is_empty() {
                let mut sum = Lanes::ZERO;
                for (potential, &density) in potentials[..used].iter().zip(&part.change[c * all..]) {
                    sum = sum + *potential * density;
                }
                change[v as usize] = change[v as usize] + sum;
            }
            if near {
                let mut sum = Lanes::ZERO;
                for (potential, &density) in potentials[low..all].iter().zip(&part.high[c * (all - low)..]) {
                    sum = sum + *potential * density;
                }
                values[v as usize] = values[v as usize] + sum;
            }
        }
    }
}

/// Marks the elements that a change of one entry mostly comes from.
fn mark(solution: &Solution<'_>, group: &Group, l: usize, vertex: u32, marked: &mut Vec<u32>) {
    let Solution { tables, unknowns, densities, .. } = solution;
    let [x, y] = [&group.x, &group.y].map(|p| p.map(|c| Lanes::splat(c.0[l])));
    let (mut values, mut others) = ([Lanes::ZERO; MAX_FUNCTIONS], [Lanes::ZERO; MAX_FUNCTIONS]);
    let mut shares = Vec::new();
    for (e, (element, part)) in unknowns.elements.iter().zip(&densities.parts).enumerate() {
        let Ok(place) = part.vertices.binary_search(&vertex) else { continue };
        let all = functions(element.degree);
        potentials(tables, &element.triangle, element.degree, &x, &mut values);
        potentials(tables, &element.triangle, element.degree, &y, &mut others);
        let [off_surface, twin] = [&group.off_surface, &group.share].map(|by| Lanes::splat(by.0[l]));
        let value = |k: usize| weigh(values[k], off_surface).0[0] - weigh(others[k], twin).0[0];
        let share: f64 = (0..all).map(|k| value(k) * part.change[place * all + k]).sum();
        shares.push((share.abs(), e as u32));
    }
    let largest = shares.iter().map(|s| s.0).fold(0.0, f64::max);
    marked.extend(shares.iter().filter(|s| s.0 >= MIN_MARKED_SHARE * largest * (1.0 - 1e-6)).map(|s| s.1));
}
