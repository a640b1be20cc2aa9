//! Rows of `Φ` from the densities.

use super::affine::AffineFit;
use super::basis::{MAX_FUNCTIONS, functions};
use super::elements::Unknowns;
use super::potential::{Tables, potentials};
use super::solve::Densities;
use crate::coordinates::layer::{INVERSE_4PI, Layers, group_potentials, write_group};
use crate::mesh::Point;
use crate::simd::{LANES, Lanes};
use faer::linalg::matmul::matmul;
use faer::{Accum, Mat, Par};
use rayon::prelude::*;

const TASK_POINTS: usize = 16 * LANES;
/// High unknowns are felt up to so many radii of their element.
const FELT: f64 = 8.0;

pub(super) struct Evaluated {
    pub(super) phi: Mat<f64>,
    /// Largest entry of each row of the change.
    pub(super) changes: Vec<f64>,
    /// Elements to be refined.
    pub(super) marked: Vec<bool>,
    /// Largest correction of a row that makes it reproduce linear functions.
    pub(super) correction: f64,
}

struct Scratch {
    layers: crate::coordinates::layer::Scratch,
    singles: Mat<f64>,
    /// High part and change of one lane group, by vertex.
    high: Vec<Lanes>,
    change: Vec<Lanes>,
}

/// `Φ` at these points, and the change from the coarse space.
pub(super) fn evaluate(
    tables: &Tables,
    layers: &Layers,
    affine: &AffineFit,
    unknowns: &Unknowns,
    densities: &Densities,
    points: &[Point],
    tolerance: f64,
) -> Evaluated {
    let m = layers.vertices().len();
    let low = unknowns.low;
    let low_degree = (0..).find(|&d| functions(d) == low).unwrap_or(0);
    let mut phi = crate::simd::zeros::<f64>(points.len(), m);
    let found: Vec<(Vec<f64>, Vec<u32>, f64)> = phi
        .as_mut()
        .par_row_chunks_mut(TASK_POINTS)
        .enumerate()
        .map_init(
            || Scratch {
                layers: layers.scratch(),
                singles: Mat::zeros(TASK_POINTS, unknowns.low_count()),
                high: vec![Lanes::ZERO; m],
                change: vec![Lanes::ZERO; m],
            },
            |scratch, (task, mut rows)| {
                let count = rows.nrows();
                let first = task * TASK_POINTS;
                let mut values = [Lanes::ZERO; MAX_FUNCTIONS];
                let mut largest = Vec::new();
                let mut marked = Vec::new();
                for start in (0..count).step_by(LANES) {
                    let x = layers.group(points, first + start);
                    group_potentials(layers, &x, &mut scratch.layers);
                    for v in 0..m {
                        scratch.high[v] = scratch.layers.double[v] * INVERSE_4PI;
                        scratch.change[v] = Lanes::ZERO;
                    }
                    let mut near = Vec::new();
                    for (e, element) in unknowns.elements.iter().enumerate() {
                        let t = &element.triangle;
                        let limit = (FELT * t.radius).powi(2);
                        let mut keep = Lanes::ZERO;
                        let mut any = false;
                        for l in 0..LANES {
                            let d2: f64 = (0..3).map(|k| (x[k].0[l] - t.centre[k]).powi(2)).sum();
                            keep.0[l] = if d2 < limit { 1.0 } else { 0.0 };
                            any |= d2 < limit;
                        }
                        let part = &densities.parts[e];
                        let any = any && !part.vertices.is_empty();
                        let degree = if any { element.degree } else { low_degree };
                        potentials(tables, t, degree, &x, &mut values);
                        for k in 0..low {
                            for l in 0..LANES.min(count - start) {
                                scratch.singles[(start + l, e * low + k)] = values[k].0[l];
                            }
                        }
                        if any {
                            near.push(e as u32);
                            let all = functions(element.degree);
                            for value in &mut values[..all] {
                                *value = *value * keep;
                            }
                            let highs = part.high.chunks_exact(all - low);
                            for ((&v, high), change) in part.vertices.iter().zip(highs).zip(part.change.chunks_exact(all)) {
                                let mut sum = scratch.high[v as usize];
                                for k in low..all {
                                    sum = sum + values[k] * high[k - low];
                                }
                                scratch.high[v as usize] = sum;
                                let mut sum = scratch.change[v as usize];
                                for k in 0..all {
                                    sum = sum + values[k] * change[k];
                                }
                                scratch.change[v as usize] = sum;
                            }
                        }
                    }
                    write_group(rows.as_mut(), start, &scratch.high, 1.0);
                    for l in 0..LANES.min(count - start) {
                        let worst = (0..m).fold(0, |a, v| {
                            if scratch.change[v].0[l].abs() > scratch.change[a].0[l].abs() { v } else { a }
                        });
                        let change = scratch.change[worst].0[l].abs();
                        largest.push(change);
                        if change > tolerance {
                            let x = x.map(|c| Lanes::splat(c.0[l]));
                            mark(tables, unknowns, densities, &near, worst as u32, &x, &mut marked);
                        }
                    }
                }
                let singles = scratch.singles.as_ref().subrows(0, count);
                matmul(rows.as_mut(), Accum::Add, singles, densities.low.as_ref(), 1.0, Par::Seq);
                let mut correction = 0.0f64;
                for i in 0..count {
                    let x = points[first + i].map(|c| c * layers.scale());
                    correction = correction.max(affine.complete(rows.as_mut(), i, x));
                }
                (largest, marked, correction)
            },
        )
        .collect();
    let mut marked = vec![false; unknowns.elements.len()];
    for &e in found.iter().flat_map(|f| &f.1) {
        marked[e as usize] = true;
    }
    let correction = found.iter().map(|f| f.2).fold(0.0, f64::max);
    Evaluated { phi, changes: found.into_iter().flat_map(|f| f.0).collect(), marked, correction }
}

/// Marks the elements that a change of one entry mostly comes from.
fn mark(
    tables: &Tables,
    unknowns: &Unknowns,
    densities: &Densities,
    near: &[u32],
    vertex: u32,
    x: &[Lanes; 3],
    marked: &mut Vec<u32>,
) {
    let mut values = [Lanes::ZERO; MAX_FUNCTIONS];
    let mut shares = Vec::new();
    for &e in near {
        let element = &unknowns.elements[e as usize];
        let part = &densities.parts[e as usize];
        let Ok(place) = part.vertices.binary_search(&vertex) else { continue };
        let all = functions(element.degree);
        potentials(tables, &element.triangle, element.degree, x, &mut values);
        let share: f64 = (0..all).map(|k| values[k].0[0] * part.change[place * all + k]).sum();
        shares.push((share.abs(), e));
    }
    let largest = shares.iter().map(|s| s.0).fold(0.0, f64::max);
    marked.extend(shares.iter().filter(|s| s.0 >= MAIN * largest).map(|s| s.1));
}

/// Elements with at least this part of the largest share of a change are marked.
const MAIN: f64 = 0.3;
