//! The high unknowns of one vertex's hat function, together with the low ones of the elements where they matter.

use super::basis::{MAX_FUNCTIONS, functions};
use super::elements::Unknowns;
use super::galerkin::NearPairs;
use super::solve::{Active, FELT};
use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::{cholesky::llt, triangular_solve};
use faer::{Mat, MatMut, MatRef, Par};

/// Unknowns of a patch at most.
const PATCH: usize = 1600;
/// Where the entries of thin elements are not exact enough to be definite, diagonals grow by these parts, one after the other.
pub(super) const DAMPING: [f64; 5] = [0.0, 1e-4, 1e-3, 1e-2, 1e-1];

/// Makes the diagonal larger by a part of it.
pub(super) fn damp(mut a: MatMut<'_, f64>, part: f64) {
    for k in 0..a.nrows() {
        a[(k, k)] *= 1.0 + part;
    }
}

/// Lower Cholesky factor in place.
pub(super) fn factor(a: MatMut<'_, f64>, par: Par) -> Option<()> {
    let mut memory = MemBuffer::new(llt::factor::cholesky_in_place_scratch::<f64>(a.nrows(), par, Default::default()));
    llt::factor::cholesky_in_place(a, Default::default(), par, MemStack::new(&mut memory), Default::default()).ok()?;
    Some(())
}

/// A matrix of zeros in memory that is used again and again.
pub(super) fn zeroed(memory: &mut Vec<f64>, rows: usize, columns: usize) -> MatMut<'_, f64> {
    memory.clear();
    memory.resize(rows * columns, 0.0);
    MatMut::from_column_major_slice_mut(memory, rows, columns)
}

/// An element of a patch and the column of the patch's vertex in it.
pub(super) type Place = (u32, u32);

/// For every vertex the elements where its high unknowns matter. Drops the other candidates.
pub(super) fn patches(
    unknowns: &Unknowns,
    high: &mut [Active],
    residuals: &mut [Mat<f64>],
    m: usize,
) -> Vec<Vec<Place>> {
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
pub(super) fn solve_patch(
    near: &NearPairs,
    far: &Mat<f32>,
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
    let mut index = vec![usize::MAX; unknowns.elements.len()];
    let mut rows = vec![[0; MAX_FUNCTIONS]; patch.len()];
    for (i, (&(e, _), rows)) in patch.iter().zip(&mut rows).enumerate() {
        index[e as usize] = i;
        rows[..functions(unknowns.elements[e as usize].degree)]
            .iter_mut()
            .enumerate()
            .for_each(|(k, r)| *r = place(i, k));
    }
    // The lower triangle, by columns. High unknowns of elements that are not near do not feel each other.
    let fill = |a: &mut [f64]| {
        a.fill(0.0);
        for (j, &(f, _)) in patch.iter().enumerate() {
            let f = f as usize;
            for c in 0..l {
                let from = far.col_as_slice(f * l + c);
                let column = &mut a[(j * l + c) * count..][..count];
                for (&(e, _), to) in patch.iter().zip(column.chunks_exact_mut(l)).skip(j) {
                    let entries = &from[e as usize * l..][..l];
                    to.iter_mut().zip(entries).for_each(|(to, entry)| *to = f64::from(*entry));
                }
            }
            for (other, entries, transposed) in near.of(f) {
                // Every pair once, as a column of its lower element.
                let i = index[other];
                if i == usize::MAX || other < f {
                    continue;
                }
                let entries = if transposed { entries } else { entries.transpose() };
                for (c, entries) in entries.col_iter().enumerate() {
                    for (entry, row) in entries.iter().zip(&rows[i]) {
                        let (row, column) = (*row, rows[j][c]);
                        a[row.max(column) + count * row.min(column)] = *entry;
                    }
                }
            }
        }
    };
    memory.resize(count * count, 0.0);
    let definite = DAMPING.iter().any(|&part| {
        fill(memory);
        let mut a = MatMut::from_column_major_slice_mut(memory, count, count);
        damp(a.as_mut(), part);
        factor(a, Par::Seq).is_some()
    });
    if !definite {
        return None;
    }
    let a = MatRef::from_column_major_slice(memory, count, count);
    let mut x = Mat::<f64>::zeros(count, 2);
    for (i, &(e, column)) in patch.iter().enumerate() {
        for (k, &value) in residuals[e as usize].col(column as usize).iter().enumerate() {
            x[(place(i, l + k), 0)] = value;
        }
    }
    triangular_solve::solve_lower_triangular_in_place(a, x.as_mut().subcols_mut(0, 1), Par::Seq);
    // The coarse unknowns are those of the leading parts of the factor and of this vector; the difference comes of the rest.
    for i in coarse..count {
        x[(i, 1)] = x[(i, 0)];
    }
    triangular_solve::solve_upper_triangular_in_place(a.transpose(), x.as_mut(), Par::Seq);
    let mut high = Vec::new();
    let mut change = Vec::new();
    for (i, &(e, _)) in patch.iter().enumerate() {
        let all = functions(unknowns.elements[e as usize].degree);
        high.extend((l..all).map(|k| x[(place(i, k), 0)]));
        change.extend((0..all).map(|k| x[(place(i, k), 1)]));
    }
    Some((high, change))
}
