//! Coordinates whose small entries are left out, for the many products of a solver that needs no more.

use cager_geometry::vector::Point;
use faer::MatRef;
use glam::DVec3;
use rayon::prelude::*;

/// The larger entries of a matrix, by rows and by columns.
pub(crate) struct SparseRows {
    rows: Compressed,
    columns: Compressed,
}

/// Lists of (number, value), back to back.
struct Compressed {
    first: Vec<u32>,
    entries: Vec<(u32, f64)>,
}

/// Products with fewer entries are computed by one thread.
const MIN_PARALLEL_ENTRIES: usize = 20_000;

impl SparseRows {
    /// The entries of a matrix that are larger than `threshold`, absolute.
    pub(crate) fn new(matrix: MatRef<'_, f64>, threshold: f64) -> Self {
        let rows = Compressed::new(matrix, threshold);
        Self { rows, columns: Compressed::new(matrix.transpose(), threshold) }
    }

    /// `A x`.
    pub(crate) fn times(&self, x: &[DVec3]) -> Vec<DVec3> {
        self.rows.times(x)
    }

    /// `Aᵀ y`.
    pub(crate) fn transposed_times(&self, y: &[DVec3]) -> Vec<DVec3> {
        self.columns.times(y)
    }
}

impl Compressed {
    fn new(matrix: MatRef<'_, f64>, threshold: f64) -> Self {
        let (mut first, mut entries) = (vec![0], Vec::new());
        for i in 0..matrix.nrows() {
            let row = matrix.row(i);
            entries.extend((0..matrix.ncols()).map(|j| (j as u32, row[j])).filter(|(_, x)| x.abs() > threshold));
            first.push(entries.len() as u32);
        }
        Self { first, entries }
    }

    fn times(&self, x: &[DVec3]) -> Vec<DVec3> {
        let row = |ends: &[u32]| -> DVec3 {
            let entries = &self.entries[ends[0] as usize..ends[1] as usize];
            entries.iter().fold(DVec3::ZERO, |sum, &(j, value)| sum + value * x[j as usize])
        };
        if self.entries.len() < MIN_PARALLEL_ENTRIES {
            return self.first.windows(2).map(row).collect();
        }
        let lists = self.first.len() - 1;
        (0..lists).into_par_iter().with_min_len(64).map(|i| row(&self.first[i..i + 2])).collect()
    }
}

/// Points as a matrix, n × 3.
pub(crate) fn matrix(points: &[DVec3]) -> faer::Mat<f64> {
    faer::Mat::from_fn(points.len(), 3, |i, k| points[i][k])
}

/// The rows of an n × 3 matrix as points.
pub(crate) fn points(matrix: MatRef<'_, f64>) -> Vec<DVec3> {
    (0..matrix.nrows()).map(|i| DVec3::new(matrix[(i, 0)], matrix[(i, 1)], matrix[(i, 2)])).collect()
}

/// As vectors.
pub(crate) fn vectors(points: &[Point]) -> Vec<DVec3> {
    points.iter().map(|&p| DVec3::from(p)).collect()
}
