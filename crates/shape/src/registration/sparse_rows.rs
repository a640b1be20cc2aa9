//! Coordinates without small entries, for the products of a solver that needs no more.

use faer::MatRef;
use glam::Vec3A;
use rayon::prelude::*;

/// The larger coordinates in single precision, by rows and by columns. Rows are scaled to sum to
/// one, so that what moves the whole cage moves every point.
pub(crate) struct SparseRows {
    rows: Compressed,
    columns: Compressed,
}

/// Lists of (number, value), back to back.
struct Compressed {
    first: Vec<u32>,
    entries: Vec<(u32, f32)>,
}

/// Rows whose larger entries sum to less are kept whole.
const MIN_KEPT: f64 = 0.5;
/// Products with fewer entries are computed by one thread.
const MIN_PARALLEL_ENTRIES: usize = 20_000;

impl SparseRows {
    /// The entries of a matrix that are larger than `threshold`, absolute.
    pub(crate) fn new(matrix: MatRef<'_, f64>, threshold: f64) -> Self {
        let mut rows: Vec<Vec<(u32, f32)>> = Vec::with_capacity(matrix.nrows());
        let mut columns: Vec<Vec<(u32, f32)>> = vec![Vec::new(); matrix.ncols()];
        for i in 0..matrix.nrows() {
            let row = matrix.row(i);
            let all = || (0..matrix.ncols()).map(|j| (j as u32, row[j]));
            let mut kept: Vec<(u32, f64)> = all().filter(|(_, x)| x.abs() > threshold).collect();
            let mut sum: f64 = kept.iter().map(|(_, x)| x).sum();
            if sum < MIN_KEPT {
                (kept, sum) = (all().collect(), 1.0);
            }
            rows.push(kept.iter().map(|&(j, x)| (j, (x / sum) as f32)).collect());
            rows[i].iter().for_each(|&(j, x)| columns[j as usize].push((i as u32, x)));
        }
        Self { rows: Compressed::new(&rows), columns: Compressed::new(&columns) }
    }

    /// `A x`.
    pub(crate) fn times(&self, x: &[Vec3A]) -> Vec<Vec3A> {
        self.rows.times(x)
    }

    /// `Aᵀ y`.
    pub(crate) fn transposed_times(&self, y: &[Vec3A]) -> Vec<Vec3A> {
        self.columns.times(y)
    }
}

impl Compressed {
    fn new(lists: &[Vec<(u32, f32)>]) -> Self {
        let ends = lists.iter().scan(0, |sum, list| {
            *sum += list.len() as u32;
            Some(*sum)
        });
        Self { first: std::iter::once(0).chain(ends).collect(), entries: lists.concat() }
    }

    fn times(&self, x: &[Vec3A]) -> Vec<Vec3A> {
        let row = |i: usize| -> Vec3A {
            let entries = &self.entries[self.first[i] as usize..self.first[i + 1] as usize];
            // Sums that are kept apart need not wait for each other.
            let (lanes, rest) = entries.as_chunks::<4>();
            let mut sums = [Vec3A::ZERO; 4];
            for lane in lanes {
                for (sum, &(j, value)) in sums.iter_mut().zip(lane) {
                    *sum += value * x[j as usize];
                }
            }
            let sum = (sums[0] + sums[1]) + (sums[2] + sums[3]);
            rest.iter().fold(sum, |sum, &(j, value)| sum + value * x[j as usize])
        };
        let lists = self.first.len() - 1;
        if self.entries.len() < MIN_PARALLEL_ENTRIES {
            return (0..lists).map(row).collect();
        }
        (0..lists).into_par_iter().with_min_len(128).map(row).collect()
    }
}
