//! Singular value decomposition.
//!
//! Square matrices go through our own three steps: reflections to bidiagonal form, divide and conquer, and the reflections
//! again on the vectors. The last two use the current rayon pool and give the same bits whatever its threads, since every
//! vector is computed by one of them alone.

mod bidiagonal;
mod divide;
mod ends;
mod secular;

pub(crate) use ends::ends;

use bidiagonal::{Bidiagonal, bidiagonalise};
use divide::{Vectors, decompose};
use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::{householder, svd as general};
use faer::{Conj, Mat, MatMut, MatRef, Par};

/// Reflections applied together.
const BLOCK: usize = 32;

/// `A = U Σ Vᵀ` of a K × m matrix.
#[derive(Clone, Debug)]
pub struct Svd {
    /// Left singular vectors: K × min(K, m).
    pub u: Mat<f64>,
    /// Singular values, descending: min(K, m).
    pub sigma: Vec<f64>,
    /// Right singular vectors, m × m; where K < m, the last m − K span the null space.
    pub v: Mat<f64>,
}

/// Singular value decomposition; `None` where it does not converge, which only non-finite entries are known to cause.
///
/// Runs on the current rayon pool; its result does not depend on it.
pub fn svd(a: MatRef<'_, f64>) -> Option<Svd> {
    let m = a.ncols();
    if a.nrows() != m || m == 0 {
        return rectangular(a);
    }
    let (mut b, scale) = reduce(a)?;
    let (mut u, mut v) = (Mat::zeros(m, m), Mat::zeros(m, m));
    decompose(&mut b.diagonal, &b.above, Vectors { left: Some(u.as_mut()), right: v.as_mut() });
    let order = descending(&b.diagonal);
    let (u, v) = rayon::join(
        || {
            let mut u = columns(u.as_ref(), &order);
            reflect(u.as_mut(), b.left.as_ref(), &b.left_scales);
            u
        },
        || {
            let mut v = columns(v.as_ref(), &order);
            reflect(v.as_mut().subrows_mut(1, m - 1), b.right.as_ref(), &b.right_scales);
            v
        },
    );
    Some(Svd { u, sigma: order.iter().map(|&i| b.diagonal[i] * scale).collect(), v })
}

/// Singular values alone, descending: min(K, m) of them.
pub(crate) fn singular_values(a: MatRef<'_, f64>) -> Option<Vec<f64>> {
    let m = a.ncols();
    if a.nrows() != m || m == 0 {
        return Some(rectangular(a)?.sigma);
    }
    let (mut b, scale) = reduce(a)?;
    decompose(&mut b.diagonal, &b.above, Vectors { left: None, right: Mat::zeros(2, m).as_mut() });
    Some(descending(&b.diagonal).into_iter().map(|i| b.diagonal[i] * scale).collect())
}

/// Bidiagonal form of a matrix over its largest entry, and that entry; `None` where one is not finite.
fn reduce(a: MatRef<'_, f64>) -> Option<(Bidiagonal, f64)> {
    let scale = a.norm_max();
    if !scale.is_finite() || !a.is_all_finite() {
        return None;
    }
    // Powers of two leave the digits as they are.
    let scale = if scale > 0.0 { scale.log2().floor().exp2() } else { 1.0 };
    let b = bidiagonalise(a, 1.0 / scale);
    Some((b, scale))
}

fn descending(sigma: &[f64]) -> Vec<usize> {
    let mut order: Vec<usize> = (0..sigma.len()).collect();
    order.sort_unstable_by(|&i, &j| sigma[j].total_cmp(&sigma[i]).then(i.cmp(&j)));
    order
}

fn columns(a: MatRef<'_, f64>, order: &[usize]) -> Mat<f64> {
    let mut picked = Mat::zeros(a.nrows(), order.len());
    for (to, &from) in order.iter().enumerate() {
        picked.col_mut(to).copy_from(a.col(from));
    }
    picked
}

/// Applies the reflections, vectors below the diagonal of `vectors` with ones on it, the last one first.
fn reflect(a: MatMut<'_, f64>, vectors: MatRef<'_, f64>, scales: &[f64]) {
    let n = vectors.ncols();
    if n == 0 {
        return;
    }
    let mut factors = Mat::zeros(BLOCK, n);
    for first in (0..n).step_by(BLOCK) {
        let size = BLOCK.min(n - first);
        let mut factor = factors.as_mut().submatrix_mut(0, first, size, size);
        for k in 0..size {
            factor[(k, k)] = scales[first + k];
        }
        let vectors = vectors.submatrix(first, first, n - first, size);
        householder::upgrade_householder_factor(factor, vectors, size, 1, Par::Seq);
    }
    let mut memory = MemBuffer::new(householder::apply_block_householder_sequence_on_the_left_in_place_scratch::<f64>(
        n,
        BLOCK,
        a.ncols(),
    ));
    householder::apply_block_householder_sequence_on_the_left_in_place_with_conj(
        vectors,
        factors.as_ref(),
        Conj::No,
        a,
        Par::Seq,
        MemStack::new(&mut memory),
    );
}

/// Sequentially, through faer.
fn rectangular(a: MatRef<'_, f64>) -> Option<Svd> {
    let (k, m) = a.shape();
    let size = k.min(m);
    // faer takes both sets of vectors thin or both full.
    let (want, width) =
        if m > size { (general::ComputeSvdVectors::Full, k) } else { (general::ComputeSvdVectors::Thin, size) };
    let (mut u, mut v) = (Mat::zeros(k, width), Mat::zeros(m, m));
    let mut s = faer::diag::Diag::zeros(size);
    let mut memory = MemBuffer::new(general::svd_scratch::<f64>(k, m, want, want, Par::Seq, Default::default()));
    general::svd(
        a,
        s.as_mut(),
        Some(u.as_mut()),
        Some(v.as_mut()),
        Par::Seq,
        MemStack::new(&mut memory),
        Default::default(),
    )
    .ok()?;
    Some(Svd { u, sigma: s.column_vector().iter().copied().collect(), v })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_alone_are_those_of_the_full_decomposition() {
        for m in [1, 2, 3, 7, 33, 64, 150] {
            let a = Mat::from_fn(m, m, |i, j| ((i * 31 + j * 17 + i * j) % 23) as f64 / (1 + i + 2 * j) as f64);
            let all = svd(a.as_ref()).unwrap().sigma;
            let values = singular_values(a.as_ref()).unwrap();
            for (x, y) in all.iter().zip(&values) {
                assert!((x - y).abs() <= 1e-14 * all[0], "{m}: {x} {y}");
            }
        }
    }

    #[test]
    fn what_is_not_finite_has_no_decomposition() {
        for bad in [f64::NAN, f64::INFINITY] {
            let a = Mat::from_fn(5, 5, |i, j| if (i, j) == (3, 1) { bad } else { 1.0 });
            assert!(svd(a.as_ref()).is_none() && singular_values(a.as_ref()).is_none());
        }
    }
}
