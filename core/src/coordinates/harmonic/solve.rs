//! Densities: low unknowns of all elements together, high ones in a patch around each vertex, in turn.
//!
//! The density of a hat function is smooth away from its star, so that its high unknowns count on a few elements only. Solving for all
//! low unknowns, then for all unknowns of the patch with the residual that is left, then for the low ones again is a
//! multiplicative Schwarz iteration, which gains more than a digit a turn.

use super::basis::functions;
use super::elements::Unknowns;
use super::galerkin::{NearPairs, Operator, RightHandSides};
use super::patch::{DAMPING, damp, factor, patches, solve_patch, zeroed};
use faer::linalg::{matmul::matmul, triangular_solve};
use faer::{Accum, Mat, MatRef, Par};
use rayon::prelude::*;

/// High unknowns count where the residual of the low ones is above this, as a value on the boundary.
pub(super) const FELT: f64 = 3e-4;
/// Turns at most.
const TURNS: usize = 6;

/// Densities on one element.
pub(super) struct Part {
    /// Vertices whose hat functions have high unknowns here.
    pub(super) vertices: Vec<u32>,
    /// Those unknowns, by vertex.
    pub(super) high: Vec<f64>,
    /// What the highest degree changes of all unknowns, by vertex.
    pub(super) change: Vec<f64>,
}

/// Densities of all hat functions.
pub(super) struct Densities {
    /// Low unknowns, each times vertices.
    pub(super) low: Mat<f64>,
    pub(super) parts: Vec<Part>,
}

/// A matrix in single precision.
pub(super) fn single(a: MatRef<'_, f64>) -> Mat<f32> {
    single_from(a, |_| 0)
}

/// The same from the row on that belongs to each column; zeros above.
fn single_from(a: MatRef<'_, f64>, first: impl Fn(usize) -> usize + Sync) -> Mat<f32> {
    let mut out = crate::simd::zeros::<f32>(a.nrows(), a.ncols());
    out.as_mut().par_col_iter_mut().zip(a.par_col_iter()).enumerate().for_each(|(j, (out, a))| {
        let first = first(j);
        faer::zip!(out.subrows_mut(first, a.nrows() - first), a.subrows(first, a.nrows() - first))
            .for_each(|faer::unzip!(out, a)| *out = *a as f32);
    });
    out
}

/// High unknowns of one element for the vertices whose hat functions have any there.
pub(super) struct Active {
    pub(super) vertices: Vec<u32>,
    /// Unknowns × vertices.
    pub(super) values: Mat<f64>,
}

/// Solves for all densities; `None` where the equations are not definite.
pub(super) fn solve(
    operator: Operator,
    b: &RightHandSides,
    unknowns: &Unknowns,
    faces: &[[u32; 3]],
) -> Option<Densities> {
    let par = Par::rayon(0);
    let m = b.low.ncols();
    // The factor takes the place of the matrix, of which the patches need entries between elements that are not near, those on and
    // below the diagonal.
    let far = single_from(operator.low.as_ref(), |j| j - j % unknowns.low);
    let mut lower = operator.low;
    let damped = |part: &f64| {
        if *part > 0.0 {
            lower.as_mut().par_col_iter_mut().zip(far.par_col_iter()).for_each(|(lower, far)| {
                faer::zip!(lower, far).for_each(|faer::unzip!(lower, far)| *lower = f64::from(*far));
            });
            damp(lower.as_mut(), *part);
        }
        factor(lower.as_mut(), par).is_some()
    };
    if !DAMPING.iter().any(damped) {
        return None;
    }
    let near = operator.near;
    let global = |mut x: Mat<f64>| {
        triangular_solve::solve_lower_triangular_in_place(lower.as_ref(), x.as_mut(), par);
        triangular_solve::solve_upper_triangular_in_place(lower.transpose(), x.as_mut(), par);
        x
    };
    let mut low = global(b.low.clone());
    let mut high: Vec<Active> = candidates(&near, unknowns, faces);
    let mut residuals = residual(&near, b, unknowns, low.as_ref(), &high);
    let patches = patches(unknowns, &mut high, &mut residuals, m);
    let mut changes: Vec<Vec<f64>> = Vec::new();
    for turn in 0..TURNS {
        if turn > 0 {
            residuals = residual(&near, b, unknowns, low.as_ref(), &high);
            if largest(unknowns, &residuals) < FELT {
                break;
            }
        }
        let found: Option<Vec<(Vec<f64>, Vec<f64>)>> = patches
            .par_iter()
            .map_init(Vec::new, |memory, patch| solve_patch(&near, &far, unknowns, patch, &residuals, memory))
            .collect();
        let found = found?;
        for (patch, (step, _)) in patches.iter().zip(&found) {
            let mut values = step.iter();
            for &(e, column) in patch {
                let active = high[e as usize].values.col_mut(column as usize);
                active.iter_mut().zip(&mut values).for_each(|(a, b)| *a += b);
            }
        }
        if turn == 0 {
            changes = found.into_iter().map(|f| f.1).collect();
        }
        // The low unknowns with these high ones.
        let mut x = b.low.clone();
        subtract_high(&near, unknowns, &high, &mut x);
        low = global(x);
    }
    let mut parts: Vec<Part> = high
        .into_iter()
        .map(|active| {
            let columns = (0..active.values.ncols()).flat_map(|c| active.values.col(c).iter().copied());
            Part { high: columns.collect(), vertices: active.vertices, change: Vec::new() }
        })
        .collect();
    for (e, part) in parts.iter_mut().enumerate() {
        part.change = vec![0.0; part.vertices.len() * functions(unknowns.elements[e].degree)];
    }
    for (patch, change) in patches.iter().zip(&changes) {
        let mut rest = change.as_slice();
        for &(e, column) in patch {
            let all = functions(unknowns.elements[e as usize].degree);
            let (mine, others) = rest.split_at(all);
            parts[e as usize].change[column as usize * all..][..all].copy_from_slice(mine);
            rest = others;
        }
    }
    Some(Densities { low, parts })
}

/// For every element the vertices with a star that is near it; no values yet.
fn candidates(near: &NearPairs, unknowns: &Unknowns, faces: &[[u32; 3]]) -> Vec<Active> {
    (0..unknowns.elements.len())
        .into_par_iter()
        .map(|e| {
            let others = near.of(e).map(|(other, _, _)| unknowns.elements[other].face as usize);
            let mut vertices: Vec<u32> = others.flat_map(|face| faces[face]).collect();
            vertices.sort_unstable();
            vertices.dedup();
            let values = Mat::zeros(unknowns.high(e).len(), vertices.len());
            Active { vertices, values }
        })
        .collect()
}

/// What the equations of the high unknowns leave, in the form of those.
fn residual(
    near: &NearPairs,
    b: &RightHandSides,
    unknowns: &Unknowns,
    low: MatRef<'_, f64>,
    high: &[Active],
) -> Vec<Mat<f64>> {
    let l = unknowns.low;
    (0..unknowns.elements.len())
        .into_par_iter()
        .map_init(Vec::new, |memory, e| {
            let mine = unknowns.high(e);
            let vertices = &high[e].vertices;
            let mut r = Mat::from_fn(mine.len(), vertices.len(), |k, c| b.high[(mine.start + k, vertices[c] as usize)]);
            for (other, entries, transposed) in near.of(e) {
                let all = functions(unknowns.elements[other].degree);
                let entries = if transposed { entries.transpose() } else { entries };
                let theirs = &high[other];
                let mut x = zeroed(memory, all, vertices.len());
                let mut at = 0;
                for (&v, mut x) in vertices.iter().zip(x.as_mut().col_iter_mut()) {
                    for k in 0..l {
                        x[k] = low[(other * l + k, v as usize)];
                    }
                    while at < theirs.vertices.len() && theirs.vertices[at] < v {
                        at += 1;
                    }
                    if theirs.vertices.get(at) == Some(&v) {
                        for k in l..all {
                            x[k] = theirs.values[(k - l, at)];
                        }
                    }
                }
                matmul(r.as_mut(), Accum::Add, entries.subrows(l, mine.len()), x.as_ref(), -1.0, Par::Seq);
            }
            r
        })
        .collect()
}

/// The largest residual, as a value on the boundary.
fn largest(unknowns: &Unknowns, residuals: &[Mat<f64>]) -> f64 {
    let of = |(e, r): (usize, &Mat<f64>)| {
        r.col_iter().map(|c| c.norm_l2()).fold(0.0, f64::max) / unknowns.elements[e].triangle.area
    };
    residuals.iter().enumerate().map(of).fold(0.0, f64::max)
}

/// Takes what the high unknowns do from the equations of the low ones.
fn subtract_high(near: &NearPairs, unknowns: &Unknowns, high: &[Active], x: &mut Mat<f64>) {
    let l = unknowns.low;
    x.as_mut().par_row_chunks_mut(l).enumerate().for_each(|(e, mut rows)| {
        for (other, entries, transposed) in near.of(e) {
            let entries = if transposed { entries.transpose() } else { entries };
            let theirs = &high[other];
            let mut product = Mat::<f64>::zeros(l, theirs.vertices.len());
            let part = entries.subrows(0, l).subcols(l, theirs.values.nrows());
            matmul(product.as_mut(), Accum::Replace, part, theirs.values.as_ref(), 1.0, Par::Seq);
            for (c, &v) in theirs.vertices.iter().enumerate() {
                for k in 0..l {
                    rows[(k, v as usize)] -= product[(k, c)];
                }
            }
        }
    });
}
