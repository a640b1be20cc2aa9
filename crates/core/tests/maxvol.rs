//! The handles: a dominant submatrix, never worse than its start, whatever the threads and the order.

mod common;

use cager_core::spectral::maxvol::{TOLERANCE, maxvol};
use common::Random;
use faer::Mat;

fn tall(n: usize, m: usize, seed: u64) -> Mat<f64> {
    let mut random = Random::new(seed);
    Mat::from_fn(n, m, |_, _| random.uniform().powi(3))
}

fn log_volume(a: &Mat<f64>, rows: &[u32]) -> f64 {
    let square = Mat::from_fn(rows.len(), rows.len(), |i, j| a[(rows[i] as usize, j)]);
    square.determinant().abs().ln()
}

#[test]
fn no_single_exchange_enlarges_the_volume_by_more_than_the_tolerance() {
    for (n, m, seed) in [(60, 60, 1), (300, 7, 2), (1000, 30, 3), (900, 45, 4)] {
        let a = tall(n, m, seed);
        let found = maxvol(a.as_ref(), TOLERANCE).unwrap();
        let square = Mat::from_fn(m, m, |i, j| a[(found.rows[i] as usize, j)]);
        let b = faer::prelude::Solve::solve(&square.transpose().partial_piv_lu(), a.transpose());
        let largest = b
            .as_ref()
            .col_iter()
            .flat_map(|c| c.iter().copied().collect::<Vec<_>>())
            .fold(0.0f64, |x, y| x.max(y.abs()));
        assert!(largest <= 1.0 + TOLERANCE + 1e-9, "{n} × {m}: {largest}");
        assert!((largest - found.volume.max_entry).abs() < 1e-9);
        assert!((log_volume(&a, &found.rows) - found.volume.log_volume).abs() < 1e-8);
    }
}

#[test]
fn the_volume_never_falls_below_that_of_the_pivoted_rows() {
    for seed in 10..40 {
        let found = maxvol(tall(200, 12, seed).as_ref(), TOLERANCE).unwrap();
        assert!(found.volume.log_volume >= found.start_log_volume - 1e-12);
        assert!(found.volume.swaps > 0 || found.volume.log_volume == found.start_log_volume);
    }
}

#[test]
fn the_handles_are_different_rows() {
    let mut rows = maxvol(tall(500, 40, 5).as_ref(), TOLERANCE).unwrap().rows;
    rows.sort_unstable();
    rows.dedup();
    assert_eq!(rows.len(), 40);
}

#[test]
fn the_number_of_threads_does_not_change_the_handles() {
    let a = tall(5_000, 60, 6);
    let with = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| maxvol(a.as_ref(), TOLERANCE).unwrap())
    };
    let one = with(1);
    for threads in [2, 3, 8] {
        let many = with(threads);
        assert_eq!(one.rows, many.rows);
        assert_eq!(one.volume.log_volume.to_bits(), many.volume.log_volume.to_bits());
        assert_eq!(one.volume.max_entry.to_bits(), many.volume.max_entry.to_bits());
    }
}

#[test]
fn dependent_columns_are_reported() {
    let mut a = tall(100, 5, 7);
    for i in 0..100 {
        a[(i, 4)] = a[(i, 0)] + a[(i, 1)];
    }
    assert!(maxvol(a.as_ref(), TOLERANCE).is_err());
    let zero = Mat::<f64>::zeros(100, 5);
    assert!(maxvol(zero.as_ref(), TOLERANCE).is_err());
}
