//! How long a comparison will take, from its size and the speed of a small matrix product.

use super::Job;
use super::sample::Sample;
use cager_core::coordinates::CoordinateSystem;
use faer::Mat;
use std::time::Instant;

/// Rows and columns of the product whose speed is measured, and how often it is.
const SIZE: usize = 384;
const REPEATS: usize = 3;

/// Multiplications of a comparison, in those of the product; the factors were fitted to measured times.
pub(super) fn work(job: &Job<'_>, system: &dyn CoordinateSystem) -> f64 {
    let frames = Sample::new(job.frames, job.frames_at_most).measured().len() as f64;
    let (points, faces) = (job.rest.points.len() as f64, job.cage.faces().len() as f64);
    let (unknowns, columns) = (system.unknowns(job.cage) as f64, system.columns(job.cage) as f64);
    let analysis = 8.0 * points * unknowns.powi(2) + 900.0 * unknowns.powi(3);
    let measuring = 50.0 * frames * points * columns;
    let iterating = if columns > unknowns { 1500.0 * frames * columns.powi(2) } else { 0.0 };
    let elements = if system.name() == "harmonic" { 3e4 * faces.powi(2) + 300.0 * faces * points } else { 0.0 };
    4e9 + analysis + measuring + iterating + elements
}

/// Seconds that a comparison will take, about.
pub(crate) fn seconds(job: &Job<'_>) -> f64 {
    let a = Mat::from_fn(SIZE, SIZE, |i, j| 1.0 / (1 + i + j) as f64);
    let product = |_| {
        let clock = Instant::now();
        std::hint::black_box(&a * &a);
        clock.elapsed().as_secs_f64()
    };
    let fastest = (0..REPEATS).map(product).fold(f64::INFINITY, f64::min);
    let total: f64 = job.systems.iter().map(|system| work(job, *system)).sum();
    total * fastest / (SIZE as f64).powi(3)
}
