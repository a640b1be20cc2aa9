//! Adam (Kingma and Ba 2015) with one second moment for each vertex, half of it the mean over all.

use cager_geometry::mesh::Point;
use glam::DVec3;

/// Share of the moments that a step keeps.
const BETA1: f64 = 0.9;
const BETA2: f64 = 0.95;

/// Moments of the gradient.
pub(super) struct Adam {
    first: Vec<DVec3>,
    second: Vec<f64>,
    steps: i32,
}

impl Adam {
    pub(super) fn new(vertices: usize) -> Self {
        Self { first: vec![DVec3::ZERO; vertices], second: vec![0.0; vertices], steps: 0 }
    }

    /// The step of each vertex, about `size` long.
    pub(super) fn step(&mut self, gradient: &[Point], size: f64) -> Vec<DVec3> {
        self.steps += 1;
        let (unbias1, unbias2) = (1.0 - BETA1.powi(self.steps), 1.0 - BETA2.powi(self.steps));
        for ((first, second), &g) in self.first.iter_mut().zip(&mut self.second).zip(gradient) {
            let g = DVec3::from(g);
            *first = BETA1 * *first + (1.0 - BETA1) * g;
            *second = BETA2 * *second + (1.0 - BETA2) * g.length_squared() / 3.0;
        }
        let mean = self.mean();
        let step = |(first, second): (&DVec3, &f64)| {
            *first * (-size / unbias1 / ((0.5 * (second + mean) / unbias2).sqrt() + f64::MIN_POSITIVE))
        };
        self.first.iter().zip(&self.second).map(step).collect()
    }

    /// Follows a change of connectivity: `kept[v]` is the previous index of vertex v, out of range
    /// for a new one, which gets the mean.
    pub(super) fn renumber(&mut self, kept: &[u32]) {
        let mean = self.mean();
        self.first = kept.iter().map(|&v| self.first.get(v as usize).copied().unwrap_or_default()).collect();
        self.second = kept.iter().map(|&v| self.second.get(v as usize).copied().unwrap_or(mean)).collect();
    }

    fn mean(&self) -> f64 {
        self.second.iter().sum::<f64>() / self.second.len() as f64
    }
}
