//! Singular value decomposition, by faer: bidiagonalisation, then divide and conquer (Gu and
//! Eisenstat 1995). Sequential, so that the bits do not depend on the number of threads.

mod ends;
mod last;

pub use ends::{ends, first_value};
pub use last::{LastDirections, last_directions};

use faer::diag::Diag;
use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::svd::{ComputeSvdVectors, SvdParams, svd as decompose, svd_scratch};
use faer::{Auto, Mat, MatRef, Par};

/// Size from which a bidiagonal matrix is split; faer's 128 is slower at some hundred columns.
const SPLIT_FROM: usize = 32;

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

/// Singular value decomposition; `None` where entries are not finite or it does not converge.
pub fn svd(a: MatRef<'_, f64>) -> Option<Svd> {
    let (k, m) = a.shape();
    // faer computes both sets of vectors thin or both full.
    let (vectors, width) = if m > k { (ComputeSvdVectors::Full, k) } else { (ComputeSvdVectors::Thin, k.min(m)) };
    let (mut u, mut v) = (Mat::zeros(k, width), Mat::zeros(m, m));
    let sigma = compute(a, vectors, Some((&mut u, &mut v)))?;
    Some(Svd { u, sigma, v })
}

/// Singular values alone, descending: min(K, m) of them.
pub fn singular_values(a: MatRef<'_, f64>) -> Option<Vec<f64>> {
    compute(a, ComputeSvdVectors::No, None)
}

fn compute(
    a: MatRef<'_, f64>,
    vectors: ComputeSvdVectors,
    uv: Option<(&mut Mat<f64>, &mut Mat<f64>)>,
) -> Option<Vec<f64>> {
    if !a.is_all_finite() {
        return None;
    }
    // faer loses very small entries; a power of two leaves the digits as they are.
    let largest = a.norm_max();
    let scale = if largest > 0.0 { largest.log2().floor().exp2() } else { 1.0 };
    let scaled = faer::zip!(a).map(|faer::unzip!(x)| x / scale);
    let (k, m) = a.shape();
    let params = SvdParams { recursion_threshold: SPLIT_FROM, ..<SvdParams as Auto<f64>>::auto() }.into();
    let mut sigma = Diag::zeros(k.min(m));
    let (u, v) = uv.map(|(u, v)| (u.as_mut(), v.as_mut())).unzip();
    let mut memory = MemBuffer::new(svd_scratch::<f64>(k, m, vectors, vectors, Par::Seq, params));
    decompose(scaled.as_ref(), sigma.as_mut(), u, v, Par::Seq, MemStack::new(&mut memory), params).ok()?;
    Some(sigma.column_vector().iter().map(|s| s * scale).collect())
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
