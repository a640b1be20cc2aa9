//! Gradient descent of a cage's least-squares error over a motion (variable projection),
//! constrained by contacts, with relocation of ineffective vertices.

use super::adam::Adam;
use super::contact::Obstacles;
use super::exchange::{self, Remeshing};
use super::fit::Fit;
use super::options::{DesignOptions, Style};
use super::samples::Samples;
use cager_core::cage::Cage;
use cager_core::coordinates::MeanValue;
use cager_geometry::linalg::accumulate_product;
use cager_geometry::mesh::{Point, TriMesh};
use faer::{Accum, Mat};
use glam::DVec3;

/// Ridge of the inner least squares, over the mean diagonal entry of `ΦᵀΦ`: cages do not follow
/// what hardly moves the model.
const RIDGE: f64 = 1e-4;
/// Length of the longest steps, as a fraction of the diagonal.
const STEP: f64 = 0.001;
/// Points of a step and of remeshing: with fewer, parts with few points seem better reproduced.
const STEP_POINTS: usize = 2_200;
const REMESH_POINTS: usize = 3_000;
/// How far vertices of an editable cage move to the mean of their neighbours in a full step.
const FAIRING: f64 = 0.02;

/// A cage under optimisation.
pub(super) struct Descent<'a> {
    pub(super) cage: Cage,
    samples: &'a Samples,
    obstacles: Obstacles,
    adam: Adam,
    random: fastrand::Rng,
    fairing: f64,
}

impl<'a> Descent<'a> {
    pub(super) fn new(cage: Cage, samples: &'a Samples, obstacles: Obstacles, options: &DesignOptions) -> Self {
        let adam = Adam::new(cage.vertices().len());
        let fairing = if options.style == Style::Editable { FAIRING } else { 0.0 };
        Self { cage, samples, obstacles, adam, random: fastrand::Rng::with_seed(options.seed), fairing }
    }

    /// One step, its length scaled by `step_scale` (1 to 0); discarded where it gives no valid
    /// cage.
    pub(super) fn step(&mut self, step_scale: f64) {
        let batch = self.samples.batch(STEP_POINTS, &mut self.random);
        let phi = MeanValue.smooth_coordinates(&self.cage, &batch.points);
        let Some(fit) = Fit::new(phi.as_ref(), batch.motion.as_ref(), RIDGE) else { return };
        // ∂E/∂Φ; the derivative through the cages vanishes where they are the best ones.
        let mut upstream = Mat::zeros(batch.points.len(), phi.ncols());
        accumulate_product(&mut upstream, Accum::Replace, fit.residual.as_ref(), fit.cages.transpose(), -2.0);
        let gradient = MeanValue.gradient(&self.cage, &batch.points, upstream.as_ref());
        if gradient.iter().flatten().any(|g| !g.is_finite()) {
            return;
        }
        let mut desired_moves = self.adam.step(&gradient, step_scale * STEP * self.samples.diagonal);
        if self.fairing > 0.0 {
            self.fair(&mut desired_moves, step_scale);
        }
        let mut mesh = self.cage.mesh().clone();
        mesh.vertices = self.obstacles.moved(&self.cage, &desired_moves).into_iter().map(Into::into).collect();
        if let Ok(moved) = Cage::new(mesh) {
            self.cage = moved;
        }
    }

    /// Moves another cage on, with more obstacles inside it.
    pub(super) fn go_back(&mut self, mesh: &TriMesh, obstacles: impl Iterator<Item = Point>) {
        if let Ok(cage) = Cage::new(mesh.clone()) {
            self.adam = Adam::new(cage.vertices().len());
            self.cage = cage;
            self.obstacles.add(obstacles);
        }
    }

    /// Adds to every move a step towards the mean of the neighbours.
    fn fair(&self, desired_moves: &mut [DVec3], step_scale: f64) {
        let x = self.cage.vertices();
        let mut sums = vec![(DVec3::ZERO, 0.0); x.len()];
        for edge in self.cage.edges() {
            let [a, b] = edge.vertices.map(|v| v as usize);
            for (v, w) in [(a, b), (b, a)] {
                sums[v].0 += DVec3::from(x[w]);
                sums[v].1 += 1.0;
            }
        }
        for ((desired_move, (sum, count)), &x) in desired_moves.iter_mut().zip(sums).zip(x) {
            *desired_move += (sum / count - DVec3::from(x)) * (step_scale * self.fairing);
        }
    }

    /// Exchanges up to a share of the vertices, and goes towards `goal` vertices by up to as many.
    pub(super) fn exchange(&mut self, share: f64, goal: usize) {
        let batch = self.samples.batch(REMESH_POINTS, &mut self.random);
        let phi = MeanValue.smooth_coordinates(&self.cage, &batch.points);
        let Some(fit) = Fit::new(phi.as_ref(), batch.motion.as_ref(), RIDGE) else { return };
        let Remeshing { mesh, kept } =
            exchange::exchange(&self.cage, &batch.points, &phi, &fit, &self.obstacles, share, goal);
        if let Ok(cage) = Cage::new(mesh) {
            self.cage = cage;
            self.adam.renumber(&kept);
        }
    }
}
