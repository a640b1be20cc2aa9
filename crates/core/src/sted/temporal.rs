//! Deviation of relative differences of movement over runs of frames.

use super::deviation::{Mean, deviation, weighted_difference};
use rayon::prelude::*;
use std::collections::VecDeque;

/// Temporal edges of the last frames.
pub(super) struct Steps {
    /// Steps between the frames of a run.
    run: usize,
    /// Length of a frame in time.
    dt: f64,
    /// Captured and decoded positions of the last frame.
    before: Option<(Vec<f64>, Vec<f64>)>,
    /// For each of the last steps, the temporal edge of every vertex and its relative difference.
    steps: VecDeque<Vec<(f64, f64)>>,
    /// Over the runs that are complete.
    runs: Mean,
}

impl Steps {
    pub(super) fn new(run: usize, dt: f64) -> Self {
        Self { run, dt, before: None, steps: VecDeque::new(), runs: Mean::default() }
    }

    pub(super) fn add<C, D>(&mut self, captured: &[C], decoded: &[D])
    where
        C: Copy + Into<f64>,
        D: Copy + Into<f64>,
    {
        let captured: Vec<f64> = captured.iter().map(|&x| x.into()).collect();
        let decoded: Vec<f64> = decoded.iter().map(|&x| x.into()).collect();
        if let Some((captured_before, decoded_before)) = &self.before {
            if self.steps.len() == self.run {
                self.steps.pop_front();
            }
            let t = lengths(captured_before, &captured, self.dt);
            let found = lengths(decoded_before, &decoded, self.dt);
            self.steps.push_back(t.zip(found).map(|(t, found)| weighted_difference(t, found)).collect());
            if self.steps.len() == self.run {
                self.runs.extend(&self.deviations());
            }
        }
        self.before = Some((captured, decoded));
    }

    /// Over all runs; of a capture that is shorter than one, over the whole.
    pub(super) fn mean(&self) -> f64 {
        let mut runs = self.runs;
        if self.steps.len() < self.run {
            runs.extend(&self.deviations());
        }
        runs.value()
    }

    fn deviations(&self) -> Vec<Option<f64>> {
        let points = self.steps.front().map_or(0, Vec::len);
        (0..points).into_par_iter().map(|v| deviation(self.steps.iter().map(move |step| step[v]))).collect()
    }
}

fn lengths<'a>(before: &'a [f64], now: &'a [f64], dt: f64) -> impl Iterator<Item = f64> + 'a {
    let squared = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| (b - a).powi(2)).sum::<f64>();
    before.chunks_exact(3).zip(now.chunks_exact(3)).map(move |(a, b)| (squared(a, b) + dt * dt).sqrt())
}
