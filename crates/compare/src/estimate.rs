//! How long a comparison will take, from its size and the speed of a small matrix product.

use super::Job;
use super::figures::{DRAW_FRAMES, DRAWS};
use super::sample::Sample;
use cager_capture::speed::seconds_per_multiplication;
use cager_core::coordinates::CoordinateSystem;

/// Methods with and without noise and draws, about, and draws among them.
const METHODS: f64 = 50.0;
const DRAWN: f64 = 2.0 * (DRAWS + 1) as f64;

/// Multiplications of a comparison; the factors were fitted to measured times.
pub(super) fn work(job: &Job<'_>, system: &dyn CoordinateSystem) -> f64 {
    let frames = Sample::new(job.frames, job.frames_at_most).measured().len() as f64;
    let (points, faces) = (job.rest.points.len() as f64, job.cage.faces().len() as f64);
    let values = system.values(job.cage);
    let (unknowns, columns) = (values.unknowns() as f64, values.columns() as f64);
    let analysis = 8.0 * points * unknowns.powi(2) + 750.0 * unknowns.powi(3);
    let measuring = METHODS * frames * points * columns;
    let iterated = (METHODS - DRAWN) * frames + DRAWN * frames.min(3.0 * DRAW_FRAMES as f64);
    let iterating = if columns > unknowns { 400.0 * iterated * columns.powi(2) } else { 0.0 };
    let elements = if system.name() == "harmonic" { 2.2e5 * faces.powi(2) } else { 0.0 };
    3e10 + analysis + measuring + iterating + elements
}

/// Seconds that a comparison will take, about.
pub fn seconds(job: &Job<'_>) -> f64 {
    let total: f64 = job.systems.iter().map(|system| work(job, *system)).sum();
    total * seconds_per_multiplication()
}

#[cfg(test)]
mod tests {
    use super::*;
    use cager_core::cage::Cage;
    use cager_core::coordinates::{Green, Harmonic, MeanValue};
    use cager_demo::{Capture, Options};

    #[test]
    fn iterations_elements_and_frames_count() {
        let capture = Capture::new(&Options { points: 400, frames: 2, cage_vertices: 200 });
        let cage = Cage::new(capture.cage.clone()).expect("a cage");
        let open = || Err(cager_formats::Error::Unsupported { path: Default::default(), what: String::new() });
        let job = |frames| Job {
            rest: &capture.rest,
            cage: &cage,
            flip_cage: false,
            open: &open,
            frames,
            systems: &[&MeanValue],
            frames_at_most: 120,
            up: None,
            names: Default::default(),
        };
        let mvc = work(&job(100), &MeanValue);
        assert!(work(&job(100), &Harmonic) > mvc && work(&job(100), &Green::Consistent) > 2.0 * mvc);
        assert!(work(&job(100), &MeanValue) > work(&job(10), &MeanValue));
        assert_eq!(work(&job(120), &MeanValue), work(&job(1000), &MeanValue));
        assert!(seconds(&job(10)) > 0.0);
    }
}
