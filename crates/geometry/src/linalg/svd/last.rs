//! The last singular values of a square matrix with their vectors, from its inverse: Rayleigh and
//! Ritz's method on a block Krylov space of `(MᵀM)⁻¹` (Golub and Underwood 1977).

use super::svd;
use crate::linalg;
use faer::{Mat, MatRef};

/// Vectors of a block beyond the wanted ones: the farther the values left out, the fewer steps.
const MARGIN: usize = 12;
/// Blocks that the space has at the most.
const MAX_BLOCKS: usize = 16;
/// Change in a step, over the largest value of the inverse, below which the values count as found.
const SETTLED: f64 = 1e-13;
/// Directions of a new block shorter than this fraction of its longest lie in the space already.
const DEPENDENT: f64 = 1e-10;

/// The last singular values of `M` with their right vectors.
#[derive(Clone, Debug)]
pub struct LastDirections {
    /// Singular values, descending: s.
    pub sigma: Vec<f64>,
    /// Right singular vectors, m × s.
    pub v: Mat<f64>,
    /// The largest singular value of all.
    pub first: f64,
}

impl LastDirections {
    /// The largest and the smallest singular value.
    pub fn ends(&self) -> [f64; 2] {
        [self.first, self.sigma[self.sigma.len() - 1]]
    }

    /// How many of them are below this fraction of the largest.
    pub fn below(&self, fraction: f64) -> usize {
        self.sigma.iter().filter(|&&x| x < fraction * self.first).count()
    }

    /// All singular values, descending, NaN between the first and the last s.
    pub fn values(&self) -> Vec<f64> {
        let mut values = vec![f64::NAN; self.v.nrows() - self.sigma.len()];
        if let Some(first) = values.first_mut() {
            *first = self.first;
        }
        values.extend(&self.sigma);
        values
    }
}

/// The last `count` singular values of M and their vectors, from `M⁻¹` and the first of the values.
/// `None` where they do not converge.
pub fn last_directions(inverse: MatRef<'_, f64>, first: f64, count: usize) -> Option<LastDirections> {
    let m = inverse.ncols();
    let width = (count + MARGIN).min(m);
    let mut random = fastrand::Rng::with_seed(0);
    let mut block = Mat::from_fn(m, width, |_, _| random.f64() - 0.5);
    let (mut space, mut images) = (Mat::<f64>::zeros(m, 0), Mat::<f64>::zeros(m, 0));
    let mut known: Vec<f64> = Vec::new();
    for _ in 0..MAX_BLOCKS {
        // Twice is enough (Kahan and Parlett).
        for _ in 0..2 {
            block -= linalg::tall_product(space.as_ref(), linalg::product(space.transpose(), block.as_ref()).as_ref());
        }
        let directions = svd(block.as_ref())?;
        let long = directions.sigma.iter().filter(|&&x| x > DEPENDENT * directions.sigma[0]).count();
        let long = long.min(m - space.ncols());
        let new = directions.u.as_ref().subcols(0, long);
        let image = linalg::tall_product(inverse.transpose(), new);
        append(&mut space, new);
        append(&mut images, image.as_ref());
        // Of `M⁻ᵀ X = U S Wᵀ` the singular vectors of M are U and `X W`, its singular values 1/S.
        let ritz = svd(images.as_ref())?;
        let values = &ritz.sigma[..count.min(ritz.sigma.len())];
        let settled = known.len() == count
            && known.iter().zip(values).all(|(before, now)| (before - now).abs() <= SETTLED * values[0]);
        if settled || space.ncols() == m {
            let v = linalg::product(space.as_ref(), ritz.v.as_ref().subcols(0, count));
            let v = Mat::from_fn(m, count, |i, j| v[(i, count - 1 - j)]);
            let sigma = values.iter().rev().map(|x| 1.0 / x).collect();
            return Some(LastDirections { sigma, v, first });
        }
        known = values.to_vec();
        block = linalg::tall_product(inverse, image.as_ref());
    }
    None
}

fn append(to: &mut Mat<f64>, columns: MatRef<'_, f64>) {
    let before = to.ncols();
    to.resize_with(columns.nrows(), before + columns.ncols(), |i, j| columns[(i, j - before)]);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_last_directions_are_those_of_the_decomposition() {
        for (m, count) in [(1, 1), (3, 2), (40, 40), (200, 1), (200, 20)] {
            // Some values twice, as symmetric cages have them.
            let value = |k: usize| 3.0 * (-0.04 * (k - k % 2) as f64).exp();
            let noise = |seed: usize| {
                let a = Mat::from_fn(m, m, |i, j| ((i * 131 + j * 71 + i * j * seed) % 89) as f64 - 44.0);
                svd(a.as_ref()).unwrap().u
            };
            let (left, right) = (noise(7), noise(13));
            let scaled = Mat::from_fn(m, m, |i, k| left[(i, k)] * value(k));
            let a = linalg::product(scaled.as_ref(), right.transpose());
            let found = last_directions(linalg::inverse(a.as_ref()).0.as_ref(), value(0), count).unwrap();
            let wanted: Vec<f64> = (m - count..m).map(value).collect();
            for (x, y) in found.sigma.iter().zip(&wanted) {
                assert!((x / y - 1.0).abs() < 1e-10, "{m} {count}: {x} {y}");
            }
            let images = linalg::product(a.as_ref(), found.v.as_ref());
            let squares = linalg::product(images.transpose(), images.as_ref());
            for (i, j) in (0..count).flat_map(|i| (0..count).map(move |j| (i, j))) {
                let expected = if i == j { found.sigma[i] * found.sigma[i] } else { 0.0 };
                let off = (squares[(i, j)] - expected).abs() / (found.sigma[i] * found.sigma[j]);
                assert!(off < 1e-9, "{m} {count}: {off:e}");
            }
            let unit = |a: &Mat<f64>| {
                let gram = linalg::product(a.transpose(), a.as_ref());
                (0..count).all(|i| (0..count).all(|j| (gram[(i, j)] - f64::from(u8::from(i == j))).abs() < 1e-9))
            };
            assert!(unit(&found.v), "{m} {count}");
        }
    }
}
