//! One method over the frames of a capture: errors of the model, spikes of the cage.

use super::sample::{Frame, Sample};
use cager_core::cage::Cage;
use cager_core::inversion::{Rows, Solver};
use cager_geometry::mesh::{Point, diagonal};
use cager_geometry::vector::distance;
use serde::Serialize;
use std::collections::VecDeque;
use std::sync::Arc;
use std::time::Instant;

/// The rest cage's edges and the unit of lengths.
#[derive(Clone, Debug)]
pub(crate) struct Shape {
    edges: Vec<[u32; 2]>,
    lengths: Vec<f64>,
    mean_length: f64,
    /// Diagonal of the rest pose's bounding box.
    pub(crate) diagonal: f64,
}

impl Shape {
    /// Of a cage around these rest points.
    pub(crate) fn new(cage: &Cage, points: &[Point]) -> Self {
        let edges: Vec<[u32; 2]> = cage.edges().iter().map(|edge| edge.vertices).collect();
        let rest = cage.vertices();
        let lengths: Vec<f64> = edges.iter().map(|e| distance(rest[e[0] as usize], rest[e[1] as usize])).collect();
        let mean_length = lengths.iter().sum::<f64>() / lengths.len() as f64;
        Self { edges, lengths, mean_length, diagonal: diagonal(points) }
    }

    /// Mean and largest change of an edge's length, over the mean length of the rest cage's edges.
    fn edge_change(&self, cage: &[f32]) -> [f64; 2] {
        let (mut sum, mut largest) = (0.0, 0.0f64);
        for (edge, rest) in self.edges.iter().zip(&self.lengths) {
            let change = (distance(vertex(cage, edge[0]), vertex(cage, edge[1])) - rest).abs() / self.mean_length;
            sum += change;
            largest = largest.max(change);
        }
        [sum / self.edges.len() as f64, largest]
    }
}

fn vertex(cage: &[f32], index: u32) -> Point {
    [0, 1, 2].map(|k| f64::from(cage[3 * index as usize + k]))
}

/// Results for every measured frame, as fractions of the rest diagonal; NaN where there is none.
#[derive(Clone, Debug, Default, Serialize)]
pub(crate) struct PerFrame {
    /// `sqrt(mean |e|²)` over the points.
    pub(crate) l2: Vec<f64>,
    /// `max |e|`.
    pub(crate) linf: Vec<f64>,
    /// Mean second temporal difference `|C_{t+1} − 2 C_t + C_{t−1}|` of a cage vertex.
    pub(crate) spike_mean: Vec<f64>,
    pub(crate) spike_max: Vec<f64>,
    /// Mean change of an edge's length, over the mean length of the rest cage's edges.
    pub(crate) edges_mean: Vec<f64>,
    pub(crate) edges_max: Vec<f64>,
}

impl PerFrame {
    fn empty(frames: usize) -> Self {
        let none = || vec![f64::NAN; frames];
        Self { l2: none(), linf: none(), spike_mean: none(), spike_max: none(), edges_mean: none(), edges_max: none() }
    }
}

/// Means and maxima over the frames.
#[derive(Clone, Copy, Debug, Serialize)]
pub(crate) struct Totals {
    pub(crate) l2_mean: f64,
    pub(crate) l2_max: f64,
    pub(crate) linf_mean: f64,
    pub(crate) linf_max: f64,
    /// Mean second temporal difference of a cage vertex; null for fewer than three frames.
    pub(crate) spike_mean: f64,
    pub(crate) spike_max: f64,
    pub(crate) edges_mean: f64,
    pub(crate) edges_max: f64,
}

impl PerFrame {
    pub(crate) fn totals(&self) -> Totals {
        Totals {
            l2_mean: mean(&self.l2),
            l2_max: max(&self.l2),
            linf_mean: mean(&self.linf),
            linf_max: max(&self.linf),
            spike_mean: mean(&self.spike_mean),
            spike_max: max(&self.spike_max),
            edges_mean: mean(&self.edges_mean),
            edges_max: max(&self.edges_max),
        }
    }
}

/// Mean of the finite values; NaN where there are none.
fn mean(values: &[f64]) -> f64 {
    let (sum, count) = values.iter().filter(|x| x.is_finite()).fold((0.0, 0.0), |(s, c), x| (s + x, c + 1.0));
    sum / count
}

/// Largest finite value; NaN where there is none.
fn max(values: &[f64]) -> f64 {
    values.iter().copied().filter(|x| x.is_finite()).fold(f64::NAN, f64::max)
}

/// The evaluation of a method over the capture.
pub(crate) struct MethodEvaluation {
    pub(crate) solver: Arc<Solver>,
    /// Whether it reads the frames with noise.
    pub(crate) noisy: bool,
    pub(crate) found: PerFrame,
    /// L2 and L∞ against the frames without noise, of one that reads them with it.
    pub(crate) clean: PerFrame,
    /// Seconds of one inversion, on one thread; NaN before the first batch.
    pub(crate) frame_seconds: f64,
    window: Window<f32>,
}

impl MethodEvaluation {
    pub(crate) fn new(solver: Arc<Solver>, noisy: bool, sample: &Sample) -> Self {
        let empty = || PerFrame::empty(sample.measured().len());
        Self { solver, noisy, found: empty(), clean: empty(), frame_seconds: f64::NAN, window: Window::default() }
    }

    /// Inverts and measures the frames that follow; `clean` are the same without noise.
    pub(crate) fn take(&mut self, frames: &[Frame], clean: &[Frame], sample: &Sample, shape: &Shape) {
        let views: Vec<&[f64]> = frames.iter().map(|frame| frame.points.as_slice()).collect();
        let previous = self.window.0.back().map(|(_, cage)| cage.as_slice());
        let clock = Instant::now();
        let cages = cages(&self.solver, previous, &views);
        self.frame_seconds = self.frame_seconds.min(clock.elapsed().as_secs_f64() / frames.len() as f64);
        let decoder = self.solver.decoder();
        let measured: Vec<usize> = (0..frames.len()).filter(|&i| frames[i].measured).collect();
        let errors = |of: &[Frame]| {
            let cages: Vec<&[f32]> = measured.iter().map(|&i| cages[i].as_slice()).collect();
            let truth: Vec<&[f64]> = measured.iter().map(|&i| of[i].points.as_slice()).collect();
            decoder.measure(&cages, &truth)
        };
        let (found, against_clean) = (errors(frames), self.noisy.then(|| errors(clean)));
        for (k, &i) in measured.iter().enumerate() {
            let Some(at) = sample.position(frames[i].number) else { continue };
            (self.found.l2[at], self.found.linf[at]) = (found[k].l2 / shape.diagonal, found[k].linf / shape.diagonal);
            if let Some(errors) = &against_clean {
                (self.clean.l2[at], self.clean.linf[at]) =
                    (errors[k].l2 / shape.diagonal, errors[k].linf / shape.diagonal);
            }
            [self.found.edges_mean[at], self.found.edges_max[at]] = shape.edge_change(&cages[i]);
        }
        let positions = decoder.positions();
        for (frame, cage) in frames.iter().zip(cages) {
            if let Some((at, [mean, max])) = self.window.push(frame.number, cage, positions, sample) {
                self.found.spike_mean[at] = mean / shape.diagonal;
                self.found.spike_max[at] = max / shape.diagonal;
            }
        }
    }
}

/// The last two poses with the numbers of their frames.
#[derive(Clone, Debug, Default)]
struct Window<T>(VecDeque<(usize, Vec<T>)>);

impl<T: Copy + Into<f64>> Window<T> {
    /// Adds the next pose; where it and both before are of successive frames, the place of the
    /// middle one in the sample, and mean and largest `|C_{t+1} − 2 C_t + C_{t−1}|` of the first
    /// `count` rows.
    fn push(&mut self, number: usize, pose: Vec<T>, count: usize, sample: &Sample) -> Option<(usize, [f64; 2])> {
        let found = match self.0.make_contiguous() {
            [(first, a), (middle, b)] if *first + 2 == number && *middle + 1 == number => {
                sample.position(*middle).map(|at| {
                    let lengths = second_differences([a, b, &pose], count);
                    let mean = lengths.iter().sum::<f64>() / count as f64;
                    (at, [mean, lengths.iter().copied().fold(0.0, f64::max)])
                })
            }
            _ => None,
        };
        if self.0.len() == 2 {
            self.0.pop_front();
        }
        self.0.push_back((number, pose));
        found
    }
}

/// Cages of frames by a method, after that of the frame before them.
pub(crate) fn cages(solver: &Solver, previous: Option<&[f32]>, frames: &[&[f64]]) -> Vec<Vec<f32>> {
    solver.invert(Rows::All, previous, frames).into_iter().map(|inverted| inverted.cage).collect()
}

fn second_differences<T: Copy + Into<f64>>([a, b, c]: [&[T]; 3], count: usize) -> Vec<f64> {
    let bend = |i: usize| -> f64 { a[i].into() - 2.0 * b[i].into() + c[i].into() };
    (0..count).map(|i| (0..3).map(|k| bend(3 * i + k).powi(2)).sum::<f64>().sqrt()).collect()
}

/// Second temporal differences of the model's own points, as a reference for those of cages.
#[derive(Clone, Debug)]
pub(crate) struct Motion {
    window: Window<f64>,
    mean: Vec<f64>,
    max: Vec<f64>,
}

impl Motion {
    pub(crate) fn new(sample: &Sample) -> Self {
        let none = vec![f64::NAN; sample.measured().len()];
        Self { window: Window::default(), mean: none.clone(), max: none }
    }

    /// Takes the frames that follow.
    pub(crate) fn take(&mut self, frames: &[Frame], sample: &Sample, diagonal: f64) {
        for frame in frames {
            let (points, count) = (frame.points.clone(), frame.points.len() / 3);
            if let Some((at, [mean, max])) = self.window.push(frame.number, points, count, sample) {
                (self.mean[at], self.max[at]) = (mean / diagonal, max / diagonal);
            }
        }
    }

    /// Mean and largest over all frames.
    pub(crate) fn totals(&self) -> [f64; 2] {
        [mean(&self.mean), max(&self.max)]
    }
}
