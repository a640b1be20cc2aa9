//! Lowering what a cage leaves of a motion: its vertices move down the gradient of the least-squares error (variable projection),
//! within what contacts allow, and idle vertices are exchanged for useful ones.

use super::adam::Adam;
use super::contact::Obstacles;
use super::exchange::{self, Exchange};
use super::fit::{Fit, product};
use super::samples::Samples;
use super::{DesignOptions, Style};
use cager_core::cage::Cage;
use cager_core::coordinates::MeanValue;
use faer::{Accum, Mat};
use glam::DVec3;

/// Ridge of the inner least squares, as a fraction of the mean diagonal entry of `ΦᵀΦ`: keeps cages from following what hardly moves the
/// model, which the encoder would not follow either.
const RIDGE: f64 = 1e-4;
/// Length of the longest steps, as a fraction of the diagonal.
const STEP: f64 = 0.001;
/// Points of one step, and of one exchange: what hangs on few vertices is seen by few points, and looks better served than it is.
const STEP_POINTS: usize = 2_200;
const EXCHANGE_POINTS: usize = 5_000;
/// Share of the way to the middle of its neighbours that a vertex of a cage for editing goes in each of the longest steps.
const FAIRING: f64 = 0.02;

/// A cage on its way.
pub(super) struct Descent<'a> {
    pub(super) cage: Cage,
    samples: &'a Samples,
    obstacles: &'a Obstacles,
    adam: Adam,
    random: fastrand::Rng,
    fairing: f64,
}

impl<'a> Descent<'a> {
    pub(super) fn new(cage: Cage, samples: &'a Samples, obstacles: &'a Obstacles, options: &DesignOptions) -> Self {
        let adam = Adam::new(cage.vertices().len());
        let fairing = if options.style == Style::Editable { FAIRING } else { 0.0 };
        Self { cage, samples, obstacles, adam, random: fastrand::Rng::with_seed(options.seed), fairing }
    }

    /// One step; `pace`, from 1 down to 0, is how long it is. A step that leaves no cage is not taken.
    pub(super) fn step(&mut self, pace: f64) {
        let batch = self.samples.batch(STEP_POINTS, &mut self.random);
        let phi = MeanValue.smooth_coordinates(&self.cage, &batch.points);
        let Some(fit) = Fit::new(phi.as_ref(), batch.motion.as_ref(), RIDGE) else { return };
        // ∂E/∂Φ; the derivative through the cages vanishes where they are the best ones.
        let mut upstream = Mat::zeros(batch.points.len(), phi.ncols());
        product(&mut upstream, Accum::Replace, fit.residual.as_ref(), fit.cages.transpose(), -2.0);
        let gradient = MeanValue.gradient(&self.cage, &batch.points, phi.as_ref(), upstream.as_ref());
        if gradient.iter().flatten().any(|g| !g.is_finite()) {
            return;
        }
        let mut wishes = self.adam.step(&gradient, pace * STEP * self.samples.diagonal);
        if self.fairing > 0.0 {
            self.fair(&mut wishes, pace);
        }
        let mut mesh = self.cage.mesh().clone();
        mesh.vertices = self.obstacles.moved(&self.cage, &wishes).into_iter().map(Into::into).collect();
        if let Ok(moved) = Cage::new(mesh) {
            self.cage = moved;
        }
    }

    /// Draws every vertex towards the middle of its neighbours.
    fn fair(&self, wishes: &mut [DVec3], pace: f64) {
        let x = self.cage.vertices();
        let mut sums = vec![(DVec3::ZERO, 0.0); x.len()];
        for edge in self.cage.edges() {
            let [a, b] = edge.vertices.map(|v| v as usize);
            for (v, w) in [(a, b), (b, a)] {
                sums[v].0 += DVec3::from(x[w]);
                sums[v].1 += 1.0;
            }
        }
        for ((wish, (sum, count)), &x) in wishes.iter_mut().zip(sums).zip(x) {
            *wish += (sum / count - DVec3::from(x)) * (pace * self.fairing);
        }
    }

    /// Exchanges up to a share of the vertices, and grows or shrinks the cage towards `goal` vertices by up to as many.
    pub(super) fn exchange(&mut self, share: f64, goal: usize) {
        let batch = self.samples.batch(EXCHANGE_POINTS, &mut self.random);
        let phi = MeanValue.smooth_coordinates(&self.cage, &batch.points);
        let Some(fit) = Fit::new(phi.as_ref(), batch.motion.as_ref(), RIDGE) else { return };
        let Exchange { mesh, kept } =
            exchange::exchange(&self.cage, &batch.points, &phi, &fit, self.obstacles, share, goal);
        if let Ok(cage) = Cage::new(mesh) {
            self.cage = cage;
            self.adam.renumber(&kept);
        }
    }
}
