//! Coordinates in single precision, for products that need every entry but not every digit.

use faer::MatRef;
use glam::DVec3;
use rayon::prelude::*;

/// Rows that sum to one, back to back: a product waits for memory, of which they take a quarter.
pub(crate) struct DenseRows {
    columns: usize,
    /// Columns with what fills them up to whole lanes.
    stride: usize,
    entries: Vec<f32>,
}

/// Sums that are kept apart, so that they are computed at once.
const LANES: usize = 8;
/// Rows are computed by one thread at the least.
const MIN_ROWS: usize = 128;
/// Rows that are summed in single precision.
const SUMMED_ROWS: usize = 128;

impl DenseRows {
    /// The entries of a matrix.
    pub(crate) fn new(matrix: MatRef<'_, f64>) -> Self {
        let (columns, stride) = (matrix.ncols(), matrix.ncols().next_multiple_of(LANES));
        let mut entries = vec![0.0; matrix.nrows() * stride];
        for (i, row) in entries.chunks_exact_mut(stride.max(1)).enumerate() {
            (0..matrix.ncols()).for_each(|j| row[j] = matrix[(i, j)] as f32);
        }
        Self { columns, stride, entries }
    }

    /// `A x`, about the middle of `x`, so that it is as exact far from the origin as near it.
    pub(crate) fn times(&self, x: &[DVec3]) -> Vec<DVec3> {
        let middle = x.iter().sum::<DVec3>() / x.len().max(1) as f64;
        let mut axes = [0; 3].map(|_| vec![0.0f32; self.stride]);
        for (j, &p) in x.iter().enumerate() {
            (0..3).for_each(|k| axes[k][j] = (p - middle)[k] as f32);
        }
        let [xs, ys, zs] = axes;
        let lanes = [&xs, &ys, &zs].map(|axis| axis.as_chunks::<LANES>().0);
        self.entries
            .par_chunks_exact(self.stride.max(1))
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

    /// `Aᵀ y`, summed in blocks that depend on the shape alone.
    pub(crate) fn transposed_times(&self, y: &[DVec3]) -> Vec<DVec3> {
        let lanes = self.stride / LANES;
        let parts: Vec<Vec<[f32; LANES]>> = self
            .entries
            .par_chunks(SUMMED_ROWS * self.stride.max(1))
            .zip(y.par_chunks(SUMMED_ROWS))
            .map(|(rows, y)| {
                let mut sums = vec![[0.0f32; LANES]; 3 * lanes];
                for (row, y) in rows.chunks_exact(self.stride).zip(y) {
                    for (sums, y) in sums.chunks_exact_mut(lanes).zip(y.as_vec3().to_array()) {
                        for (sum, row) in sums.iter_mut().zip(row.as_chunks::<LANES>().0) {
                            (0..LANES).for_each(|k| sum[k] += y * row[k]);
                        }
                    }
                }
                sums
            })
            .collect();
        let at = |part: &[[f32; LANES]], axis: usize, j: usize| f64::from(part[axis * lanes + j / LANES][j % LANES]);
        let sum = |axis: usize, j: usize| parts.iter().map(|part| at(part, axis, j)).sum();
        (0..self.columns).map(|j| DVec3::from_array([0, 1, 2].map(|axis| sum(axis, j)))).collect()
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
        let y: Vec<DVec3> = (0..300).map(|_| DVec3::new(random.f64() - 0.5, random.f64(), 1.0)).collect();
        let sums = DenseRows::new(rows.as_ref()).transposed_times(&y);
        assert_eq!(sums.len(), 45);
        for (j, found) in sums.into_iter().enumerate() {
            let exact: DVec3 = (0..300).map(|i| rows[(i, j)] * y[i]).sum();
            assert!(found.distance(exact) < 1e-5, "{found} is not {exact}");
        }
    }
}
