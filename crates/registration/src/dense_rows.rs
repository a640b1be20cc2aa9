//! Coordinates in single precision, for the many products that need every entry but not every digit.

use faer::MatRef;
use glam::DVec3;
use rayon::prelude::*;

/// Rows that sum to one, back to back. They take a quarter of the memory that passes through a product in double precision that packs them first, and that is what it waits for.
pub(crate) struct DenseRows {
    columns: usize,
    entries: Vec<f32>,
}

/// Sums that are kept apart, so that they are computed at once.
const LANES: usize = 8;
/// Rows are computed by one thread at the least.
const MIN_ROWS: usize = 128;

impl DenseRows {
    /// The entries of a matrix.
    pub(crate) fn new(matrix: MatRef<'_, f64>) -> Self {
        let columns = matrix.ncols().next_multiple_of(LANES);
        let mut entries = vec![0.0; matrix.nrows() * columns];
        for (i, row) in entries.chunks_exact_mut(columns.max(1)).enumerate() {
            (0..matrix.ncols()).for_each(|j| row[j] = matrix[(i, j)] as f32);
        }
        Self { columns, entries }
    }

    /// `A x`, about the middle of `x`, so that it is as exact far from the origin as near it.
    pub(crate) fn times(&self, x: &[DVec3]) -> Vec<DVec3> {
        let middle = x.iter().sum::<DVec3>() / x.len().max(1) as f64;
        let mut axes = [0; 3].map(|_| vec![0.0f32; self.columns]);
        for (j, &p) in x.iter().enumerate() {
            (0..3).for_each(|k| axes[k][j] = (p - middle)[k] as f32);
        }
        let [xs, ys, zs] = axes;
        let lanes = [&xs, &ys, &zs].map(|axis| axis.as_chunks::<LANES>().0);
        self.entries
            .par_chunks_exact(self.columns.max(1))
            .with_min_len(MIN_ROWS)
            .map(|row| {
                let mut sums = [[0.0f32; LANES]; 3];
                for (j, row) in row.as_chunks::<LANES>().0.iter().enumerate() {
                    for (sum, axis) in sums.iter_mut().zip(lanes) {
                        for k in 0..LANES {
                            sum[k] += row[k] * axis[j][k];
                        }
                    }
                }
                middle + DVec3::from_array(sums.map(|sum| sum.iter().map(|&x| f64::from(x)).sum()))
            })
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use faer::Mat;

    #[test]
    fn products_are_exact_to_a_millionth_far_from_the_origin() {
        let mut random = fastrand::Rng::with_seed(1);
        let mut rows = Mat::from_fn(300, 45, |_, _| random.f64());
        for i in 0..300 {
            let sum: f64 = (0..45).map(|j| rows[(i, j)]).sum();
            (0..45).for_each(|j| rows[(i, j)] /= sum);
        }
        let x: Vec<DVec3> = (0..45).map(|_| DVec3::new(1e4 + random.f64(), random.f64(), -random.f64())).collect();
        for (i, found) in DenseRows::new(rows.as_ref()).times(&x).into_iter().enumerate() {
            let exact: DVec3 = (0..45).map(|j| rows[(i, j)] * x[j]).sum();
            assert!(found.distance(exact) < 1e-6, "{found} is not {exact}");
        }
    }
}
