//! How long preparations take: measured by step, and estimated by a matrix product.

use cager_core::cage::Cage;
use cager_core::coordinates::CoordinateSystem;
use cager_core::inversion::Step;
use faer::linalg::matmul::matmul;
use faer::{Accum, Mat, Par};
use std::cell::RefCell;
use std::time::Instant;

/// When the steps of a preparation began.
#[derive(Default)]
pub struct StepClock(RefCell<Vec<(Step, Instant)>>);

impl StepClock {
    /// Notes that a step begins.
    pub fn begin(&self, step: Step) {
        self.0.borrow_mut().push((step, Instant::now()));
    }

    /// Seconds for the coordinates, for the handles, and for all else up to now.
    pub fn seconds(&self) -> [f64; 3] {
        let (now, begun) = (Instant::now(), self.0.borrow());
        let mut seconds = [0.0; 3];
        for (k, (step, begin)) in begun.iter().enumerate() {
            let end = begun.get(k + 1).map_or(now, |(_, begin)| *begin);
            let of = match step {
                Step::Coordinates => 0,
                Step::Handles => 1,
                Step::SingularValues | Step::Operator => 2,
            };
            seconds[of] += (end - *begin).as_secs_f64();
        }
        seconds
    }
}

/// Size of the timed matrix product, and number of repetitions.
const SIZE: usize = 384;
const REPEATS: usize = 10;

/// Seconds per multiply-add in a single-threaded matrix product.
pub fn seconds_per_multiplication() -> f64 {
    let a = Mat::from_fn(SIZE, SIZE, |i, j| 1.0 / (1 + i + j) as f64);
    let mut out = a.clone();
    let product = |_| {
        let clock = Instant::now();
        matmul(out.as_mut(), Accum::Replace, a.as_ref(), a.as_ref(), 1.0, Par::Seq);
        clock.elapsed().as_secs_f64()
    };
    (0..REPEATS).map(product).fold(f64::INFINITY, f64::min) / (SIZE as f64).powi(3)
}

/// Estimated seconds to prepare a solver; the factors are fitted to measurements.
pub fn seconds_to_prepare(system: &dyn CoordinateSystem, cage: &Cage, points: usize) -> f64 {
    /// Points that are analysed at the most, times unknowns, as the core has it.
    const ANALYSED: f64 = (1u64 << 25) as f64;
    let (n, m, faces) = (points as f64, system.values(cage).unknowns() as f64, cage.faces().len() as f64);
    let of_points = n * faces * 400.0 + n.min((ANALYSED / m).max(8.0 * m)) * m * m * 3.0;
    let of_cage = 17.0 * m.powi(3) + if system.pointwise().is_none() { 2.2e5 * faces.powi(2) } else { 0.0 };
    (of_points + of_cage) * seconds_per_multiplication() / rayon::current_num_threads() as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use cager_core::coordinates::MeanValue;
    use cager_core::inversion::{PrepareContext, Solver, SolverOptions};
    use cager_demo::{Capture, Options};
    use std::ops::ControlFlow;

    #[test]
    fn each_step_of_a_preparation_takes_time() {
        let Capture { rest, cage, .. } = Capture::new(&Options { points: 400, frames: 2, cage_vertices: 42 });
        let cage = Cage::new(cage).expect("a cage");
        let clock = StepClock::default();
        let before_step = |step| {
            clock.begin(step);
            ControlFlow::Continue(())
        };
        let context = PrepareContext { before_step: &before_step, ..PrepareContext::default() };
        Solver::prepare_with(&MeanValue, &cage, &rest.points, SolverOptions::PAPER, &context).expect("a solver");
        let seconds = clock.seconds();
        assert!(seconds.iter().all(|&time| time > 0.0), "{seconds:?}");
    }

    #[test]
    fn larger_models_and_cages_take_longer() {
        let seconds = |points, cage_vertices| {
            let cage = Capture::new(&Options { points: 400, frames: 2, cage_vertices }).cage;
            seconds_to_prepare(&MeanValue, &Cage::new(cage).expect("a cage"), points)
        };
        let speed = seconds_per_multiplication();
        assert!(speed > 1e-13 && speed < 1e-6, "{speed}");
        assert!(seconds(1_000_000, 300) > 5.0 * seconds(10_000, 300));
        assert!(seconds(10_000, 1_200) > 3.0 * seconds(10_000, 300));
    }
}
