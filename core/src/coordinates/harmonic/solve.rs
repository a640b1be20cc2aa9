//! Densities: low unknowns of all elements together, high ones in a patch around each vertex, in turn.
//!
//! The density of a hat function is smooth away from its star, so that its high unknowns count on a few elements only. Solving for all
//! low unknowns, then for all unknowns of the patch with the residual that is left, then for the low ones again is a
//! multiplicative Schwarz iteration, which gains more than a digit a turn.

use super::basis::functions;
use super::elements::Unknowns;
use super::galerkin::{NearPairs, Operator, RightHandSides};
use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::{cholesky::llt, matmul::matmul, triangular_solve};
use faer::{Accum, Mat, MatMut, MatRef, Par};
use rayon::prelude::*;

/// High unknowns count where the residual of the low ones is above this, as a value on the boundary.
const FELT: f64 = 3e-4;
/// Turns at most.
const TURNS: usize = 6;
/// Unknowns of a patch at most.
const PATCH: usize = 1600;

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

/// Lower Cholesky factor in place.
fn factor(a: MatMut<'_, f64>, par: Par) -> Option<()> {
    let mut memory = MemBuffer::new(llt::factor::cholesky_in_place_scratch::<f64>(a.nrows(), par, Default::default()));
    llt::factor::cholesky_in_place(a, Default::default(), par, MemStack::new(&mut memory), Default::default()).ok()?;
    Some(())
}

/// A matrix in single precision.
fn single(a: MatRef<'_, f64>) -> Mat<f32> {
    let mut out = crate::simd::zeros::<f32>(a.nrows(), a.ncols());
    out.as_mut().par_col_iter_mut().zip(a.par_col_iter()).for_each(|(out, a)| {
        faer::zip!(out, a).for_each(|faer::unzip!(out, a)| *out = *a as f32);
    });
    out
}

/// High unknowns of one element for the vertices whose hat functions have any there.
struct Active {
    vertices: Vec<u32>,
    /// Unknowns × vertices.
    values: Mat<f64>,
}

/// Solves for all densities; `None` where the equations are not definite.
pub(super) fn solve(operator: Operator, b: &RightHandSides, unknowns: &Unknowns, faces: &[[u32; 3]]) -> Option<Densities> {
    let par = Par::rayon(0);
    let m = b.low.ncols();
    // The factor takes the place of the matrix, of which the patches need entries between elements that are not near.
    let far = single(operator.low.as_ref());
    let mut lower = operator.low;
    factor(lower.as_mut(), par)?;
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
            let left = largest(unknowns, &residuals);
            if left < FELT {
                break;
            }
        }
        let found: Option<Vec<(Vec<f64>, Vec<f64>)>> =
            patches
            .par_iter()
            .map_init(Vec::new, |memory, patch| solve_patch(&near, far.as_ref(), unknowns, patch, &residuals, memory))
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
        .map_init(<[Vec<f64>; 2]>::default, |[a, x], e| {
            let mine = unknowns.high(e);
            let vertices = &high[e].vertices;
            let mut r = Mat::from_fn(mine.len(), vertices.len(), |k, c| b.high[(mine.start + k, vertices[c] as usize)]);
            let count: usize = near.of(e).map(|(other, _, _)| functions(unknowns.elements[other].degree)).sum();
            let mut a = zeroed(a, mine.len(), count);
            let mut x = zeroed(x, count, vertices.len());
            let mut start = 0;
            for (other, entries, transposed) in near.of(e) {
                let all = functions(unknowns.elements[other].degree);
                let entries = if transposed { entries.transpose() } else { entries };
                a.as_mut().subcols_mut(start, all).copy_from(entries.subrows(l, mine.len()));
                let theirs = &high[other];
                let mut at = 0;
                for (c, &v) in vertices.iter().enumerate() {
                    for k in 0..l {
                        x[(start + k, c)] = low[(other * l + k, v as usize)];
                    }
                    while at < theirs.vertices.len() && theirs.vertices[at] < v {
                        at += 1;
                    }
                    if theirs.vertices.get(at) == Some(&v) {
                        for k in l..all {
                            x[(start + k, c)] = theirs.values[(k - l, at)];
                        }
                    }
                }
                start += all;
            }
            matmul(r.as_mut(), Accum::Add, a.as_ref(), x.as_ref(), -1.0, Par::Seq);
            r
        })
        .collect()
}

/// A matrix of zeros in memory that is used again and again.
fn zeroed(memory: &mut Vec<f64>, rows: usize, columns: usize) -> MatMut<'_, f64> {
    memory.clear();
    memory.resize(rows * columns, 0.0);
    MatMut::from_column_major_slice_mut(memory, rows, columns)
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

/// An element of a patch and the column of the patch's vertex in it.
type Place = (u32, u32);

/// For every vertex the elements where its high unknowns matter. Drops the other candidates.
fn patches(unknowns: &Unknowns, high: &mut [Active], residuals: &mut [Mat<f64>], m: usize) -> Vec<Vec<Place>> {
    let mut sizes: Vec<Vec<(f64, u32)>> = vec![Vec::new(); m];
    for (e, (active, residual)) in high.iter().zip(residuals.iter()).enumerate() {
        let area = unknowns.elements[e].triangle.area;
        for (c, &v) in active.vertices.iter().enumerate() {
            // The norm of orthonormal polynomials does not depend on the order of corners.
            let size = residual.col(c).norm_l2() / area;
            if size > FELT {
                sizes[v as usize].push((size, e as u32));
            }
        }
    }
    let mut kept: Vec<Vec<u32>> = vec![Vec::new(); high.len()];
    for (v, sizes) in sizes.iter_mut().enumerate() {
        sizes.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
        let mut count = 0;
        for &(_, e) in sizes.iter() {
            count += functions(unknowns.elements[e as usize].degree);
            if count > PATCH {
                break;
            }
            kept[e as usize].push(v as u32);
        }
    }
    let mut patches = vec![Vec::new(); m];
    for (e, kept) in kept.into_iter().enumerate() {
        let old = &high[e].vertices;
        let columns: Vec<usize> = kept.iter().filter_map(|v| old.binary_search(v).ok()).collect();
        let rows = residuals[e].nrows();
        residuals[e] = Mat::from_fn(rows, columns.len(), |k, c| residuals[e][(k, columns[c])]);
        for (c, &v) in kept.iter().enumerate() {
            patches[v as usize].push((e as u32, c as u32));
        }
        high[e] = Active { values: Mat::zeros(rows, kept.len()), vertices: kept };
    }
    patches
}

/// High unknowns of a patch, by element, and what the highest degrees change of all unknowns there.
fn solve_patch(
    near: &NearPairs,
    far: MatRef<'_, f32>,
    unknowns: &Unknowns,
    patch: &[Place],
    residuals: &[Mat<f64>],
    memory: &mut Vec<f64>,
) -> Option<(Vec<f64>, Vec<f64>)> {
    let l = unknowns.low;
    // Places in the patch's matrix: low ones of all elements, then the others but the highest degree, then this.
    let middle = |e: usize| functions(unknowns.elements[e].degree - 1).max(l);
    let mut places: Vec<[usize; 2]> = Vec::with_capacity(patch.len());
    let mut count = l * patch.len();
    for &(e, _) in patch {
        places.push([count, 0]);
        count += middle(e as usize) - l;
    }
    let coarse = count;
    for (place, &(e, _)) in places.iter_mut().zip(patch) {
        place[1] = count;
        count += functions(unknowns.elements[e as usize].degree) - middle(e as usize);
    }
    let place = |i: usize, k: usize| {
        let middle = middle(patch[i].0 as usize);
        if k < l {
            i * l + k
        } else if k < middle {
            places[i][0] + k - l
        } else {
            places[i][1] + k - middle
        }
    };
    let mut a = zeroed(memory, count, count);
    let mut index = vec![usize::MAX; unknowns.elements.len()];
    for (i, &(e, _)) in patch.iter().enumerate() {
        index[e as usize] = i;
    }
    for (j, &(f, _)) in patch.iter().enumerate() {
        let f = f as usize;
        for c in 0..l {
            for (i, &(e, _)) in patch.iter().enumerate().skip(j) {
                let e = e as usize;
                for r in 0..l {
                    a[(i * l + r, j * l + c)] = f64::from(far[(e * l + r, f * l + c)]);
                }
            }
        }
        for (other, entries, transposed) in near.of(f) {
            // Every pair once, as a column of its lower element.
            let i = index[other];
            if i == usize::MAX || other < f {
                continue;
            }
            let entries = if transposed { entries } else { entries.transpose() };
            for c in 0..entries.ncols() {
                for r in 0..entries.nrows() {
                    let (row, column) = (place(i, r), place(j, c));
                    a[(row.max(column), row.min(column))] = entries[(r, c)];
                }
            }
        }
    }
    factor(a.as_mut(), Par::Seq)?;
    let mut x = Mat::<f64>::zeros(count, 2);
    for (i, &(e, column)) in patch.iter().enumerate() {
        for (k, &value) in residuals[e as usize].col(column as usize).iter().enumerate() {
            x[(place(i, l + k), 0)] = value;
        }
    }
    triangular_solve::solve_lower_triangular_in_place(a.as_ref(), x.as_mut().subcols_mut(0, 1), Par::Seq);
    // The coarse unknowns are those of the leading parts of the factor and of this vector; the difference comes of the rest.
    for i in coarse..count {
        x[(i, 1)] = x[(i, 0)];
    }
    triangular_solve::solve_upper_triangular_in_place(a.as_ref().transpose(), x.as_mut(), Par::Seq);
    let mut high = Vec::new();
    let mut change = Vec::new();
    for (i, &(e, _)) in patch.iter().enumerate() {
        let all = functions(unknowns.elements[e as usize].degree);
        high.extend((l..all).map(|k| x[(place(i, k), 0)]));
        change.extend((0..all).map(|k| x[(place(i, k), 1)]));
    }
    Some((high, change))
}
