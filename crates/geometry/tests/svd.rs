//! The singular value decomposition: exact to rounding, orthogonal in every case, whatever the threads.

use cager_geometry::linalg::svd::{Svd, svd};
use faer::Mat;

fn random(rows: usize, columns: usize, seed: u64) -> Mat<f64> {
    let mut random = fastrand::Rng::with_seed(seed);
    Mat::from_fn(rows, columns, |_, _| 2.0 * random.f64() - 1.0)
}

fn check(name: &str, a: &Mat<f64>) -> Vec<f64> {
    let Svd { u, sigma, v } = svd(a.as_ref()).unwrap_or_else(|| panic!("{name}: no decomposition"));
    let m = a.ncols();
    let rounding = 4e-15 * (m as f64).sqrt();
    let scaled = Mat::from_fn(a.nrows(), sigma.len(), |i, j| u[(i, j)] * sigma[j]);
    let residual = (&scaled * v.as_ref().subcols(0, sigma.len()).transpose() - a).norm_max();
    assert!(residual <= rounding * sigma[0], "{name}: residual {residual:.1e} of {:.1e}", sigma[0]);
    for (side, vectors) in [("left", &u), ("right", &v)] {
        let product = vectors.transpose() * vectors;
        let off = (product - Mat::<f64>::identity(vectors.ncols(), vectors.ncols())).norm_max();
        assert!(off <= rounding, "{name}: {side} vectors are orthogonal to {off:.1e}");
    }
    assert!(sigma.windows(2).all(|w| w[0] >= w[1]) && sigma.iter().all(|&s| s >= 0.0), "{name}: not descending");
    sigma
}

#[test]
fn every_size_decomposes() {
    for m in (1..40).chain([47, 48, 49, 64, 65, 96, 97, 150, 332]) {
        check(&format!("random {m}"), &random(m, m, m as u64));
    }
}

#[test]
fn rectangular_matrices_decompose() {
    check("tall", &random(30, 12, 1));
    let Svd { u, sigma, v } = svd(random(12, 30, 2).as_ref()).unwrap();
    assert_eq!((u.shape(), sigma.len(), v.shape()), ((12, 12), 12, (30, 30)));
    check("wide", &random(12, 30, 2));
}

#[test]
fn degenerate_matrices_decompose() {
    let m = 90;
    let mut r = fastrand::Rng::with_seed(7);
    check("hilbert", &Mat::from_fn(m, m, |i, j| 1.0 / (i + j + 1) as f64));
    check("graded", &Mat::from_fn(m, m, |i, j| r.f64() * 10f64.powi(-((i + j) as i32) / 3)));
    check("graded upwards", &Mat::from_fn(m, m, |i, j| r.f64() * 10f64.powi((i + j) as i32 / 3 - 60)));
    check("low rank", &(random(m, 5, 3) * random(5, m, 4)));
    check("tiny", &(random(m, m, 5) * faer::Scale(1e-290)));
    check("huge", &(random(m, m, 6) * faer::Scale(1e290)));
    check("ones", &Mat::from_fn(m, m, |_, _| 1.0));
    check("one entry", &Mat::from_fn(m, m, |i, j| if (i, j) == (70, 3) { -2.0 } else { 0.0 }));
    check("upper bidiagonal", &Mat::from_fn(m, m, |i, j| if j == i || j == i + 1 { 1.0 } else { 0.0 }));
    check("zero columns", &Mat::from_fn(m, m, |i, j| if j % 3 == 0 { 0.0 } else { ((i * j) % 11) as f64 }));
    let zero = check("zero", &Mat::zeros(m, m));
    assert!(zero.iter().all(|&s| s == 0.0));
}

#[test]
fn given_singular_values_are_found() {
    let m = 120;
    let basis = |seed| svd(random(m, m, seed).as_ref()).unwrap().u;
    let (u, v) = (basis(8), basis(9));
    let two_clusters = |k| if k < 60 { 1.0 + 1e-15 * (60 - k) as f64 } else { 1e-6 };
    let cases = [
        ("all equal", vec![3.0; m]),
        ("two clusters", (0..m).map(two_clusters).collect()),
        ("geometric", (0..m).map(|k| 0.8f64.powi(k as i32)).collect()),
        ("pairs", (0..m).map(|k| 1.0 / (1 + k / 2) as f64).collect()),
    ];
    for (name, given) in cases {
        let a = Mat::from_fn(m, m, |i, j| u[(i, j)] * given[j]) * v.transpose();
        for (k, (found, given)) in check(name, &a).iter().zip(&given).enumerate() {
            assert!((found - given).abs() < 1e-13, "{name}: value {k} is {found}, not {given}");
        }
    }
}

#[test]
fn the_number_of_threads_does_not_change_a_bit() {
    let a = random(200, 200, 10);
    let with = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| svd(a.as_ref()).unwrap())
    };
    let one = with(1);
    for threads in [2, 3, 8] {
        let many = with(threads);
        assert!(one.u == many.u && one.sigma == many.sigma && one.v == many.v, "{threads} threads");
    }
}
