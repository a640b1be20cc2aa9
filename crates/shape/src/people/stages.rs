//! The unknowns of each stage of a fit, what they make of the cage, and what holds them back.

use super::equations::NormalEquations;
use super::model::CAGE_UNKNOWNS;
use super::options::FitOptions;
use crate::Similarity;
use crate::people::manifold::Manifold;
use crate::people::rig::{BONES, CAGE_VERTICES, Deformed, QUAD_UNKNOWNS, Rig, deform, stepped, triangles};
use cager_geometry::linalg::{multiply, zeros};
use cager_geometry::mesh::Point;
use faer::Mat;
use glam::DVec3;
use rayon::prelude::*;
use std::collections::BTreeSet;

/// Unknowns of a fit.
pub(super) trait Stage {
    /// The cage under them, for the derivatives.
    fn linearized(&self) -> Linearized;
    /// Adds what holds them back.
    fn hold(&self, equations: &mut NormalEquations);
    /// Changes them by a step.
    fn step(&mut self, step: &[f64]);
}

/// A cage, and how derivatives by its vertices become those by the unknowns.
pub(super) struct Linearized {
    pub(super) vertices: Vec<Point>,
    by: By,
}

enum By {
    Vertices,
    Quads(Deformed),
    /// Through the derivatives of placement and pose by the unknowns: unknowns × (6 + 126).
    Through(Deformed, Mat<f64>),
}

impl Linearized {
    /// Numbers of a row before [`Self::through`].
    pub(super) fn width(&self) -> usize {
        match self.by {
            By::Vertices => CAGE_UNKNOWNS,
            By::Quads(_) | By::Through(..) => 6 + QUAD_UNKNOWNS,
        }
    }

    /// Takes derivatives by the vertices to those by placement and pose, or leaves them.
    pub(super) fn pull(&self, row: &[f64], out: &mut [f64]) {
        match &self.by {
            By::Vertices => out.copy_from_slice(row),
            By::Quads(deformed) | By::Through(deformed, _) => deformed.pull(row, out),
        }
    }

    /// Takes such rows, one column each, to derivatives by the unknowns.
    pub(super) fn through(&self, rows: Mat<f64>) -> Mat<f64> {
        match &self.by {
            By::Through(_, basis) => {
                let mut out = zeros(basis.nrows(), rows.ncols());
                let blocks = out.as_mut().par_col_chunks_mut(BLOCK).enumerate();
                blocks.for_each(|(k, block)| {
                    let count = block.ncols();
                    multiply(block, basis.as_ref(), rows.as_ref().subcols(k * BLOCK, count));
                });
                out
            }
            _ => rows,
        }
    }
}

/// Columns of a product that one task computes.
const BLOCK: usize = 256;

/// Which of placement and latent numbers are unknown.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Free {
    Both,
    Placement,
    Latent,
}

/// Stage (a): the placement of the pelvis and latent numbers `x`, with the prior of the manifold.
pub(super) struct LatentStage<'a> {
    pub(super) rig: &'a Rig,
    pub(super) manifold: &'a Manifold,
    pub(super) placement: Similarity,
    pub(super) latent: Vec<f64>,
    /// What poses are off the manifold by: it is shifted to pass through the last fit.
    pub(super) offset: Vec<f64>,
    pub(super) weight: f64,
    pub(super) free: Free,
}

impl LatentStage<'_> {
    /// The pose under the present latent numbers.
    pub(super) fn pose(&self) -> Vec<f64> {
        self.manifold.pose(&self.latent).iter().zip(&self.offset).map(|(y, d)| y + d).collect()
    }
}

impl Stage for LatentStage<'_> {
    fn linearized(&self) -> Linearized {
        let deformed = deform(self.rig, &self.pose(), &self.placement);
        let vertices = deformed.vertices.clone();
        let basis = self.manifold.jacobian(&self.latent);
        let (places, latents) = match self.free {
            Free::Both => (6, basis.len()),
            Free::Placement => (6, 0),
            Free::Latent => (0, basis.len()),
        };
        let entry = |i: usize, j: usize| match (i.checked_sub(places), j.checked_sub(6)) {
            (Some(k), Some(y)) => basis[k][y],
            (None, None) if i == j => 1.0,
            _ => 0.0,
        };
        let by = By::Through(deformed, Mat::from_fn(places + latents, 6 + QUAD_UNKNOWNS, entry));
        Linearized { vertices, by }
    }

    fn hold(&self, equations: &mut NormalEquations) {
        let first = match self.free {
            Free::Both => 6,
            Free::Placement => return,
            Free::Latent => 0,
        };
        let prior = self.manifold.prior(&self.latent);
        for (residual, row) in prior.residuals.iter().zip(&prior.jacobian) {
            let row: Vec<_> = row.iter().enumerate().map(|(k, d)| (first + k, self.weight * d)).collect();
            equations.add(self.weight * residual, &row);
        }
    }

    fn step(&mut self, step: &[f64]) {
        let latent = match self.free {
            Free::Both => &step[6..],
            Free::Placement => &[],
            Free::Latent => step,
        };
        if self.free != Free::Latent {
            self.placement = stepped(&self.placement, step);
        }
        self.latent.iter_mut().zip(latent).for_each(|(x, d)| *x += d);
    }
}

/// Stage (b): placement and quads, held by `‖W(y − ŷ)‖²` and the lengths of bones.
pub(super) struct QuadStage<'a> {
    pub(super) rig: &'a Rig,
    pub(super) placement: Similarity,
    pub(super) pose: Vec<f64>,
    /// The pose near which the quads stay: the first.
    pub(super) target: Vec<f64>,
    /// Weights of position and rotation.
    pub(super) weights: [f64; 2],
    pub(super) bones: f64,
}

impl<'a> QuadStage<'a> {
    pub(super) fn new(rig: &'a Rig, height: f64, options: &FitOptions, placement: Similarity, pose: Vec<f64>) -> Self {
        // The paper's own local adjustment holds quads by nothing.
        let held = f64::from(u8::from(options.method == super::Method::Robust));
        let weights = [options.quads / (0.03 * height), options.quads * 3.0].map(|w| w * held);
        Self { rig, placement, target: pose.clone(), pose, weights, bones: held * options.bones / (0.004 * height) }
    }
}

impl Stage for QuadStage<'_> {
    fn linearized(&self) -> Linearized {
        let deformed = deform(self.rig, &self.pose, &self.placement);
        Linearized { vertices: deformed.vertices.clone(), by: By::Quads(deformed) }
    }

    fn hold(&self, equations: &mut NormalEquations) {
        if self.bones == 0.0 {
            return;
        }
        for (k, (y, target)) in self.pose.iter().zip(&self.target).enumerate() {
            let weight = self.weights[usize::from(k % 6 >= 3)];
            equations.add(weight * (y - target), &[(6 + k, weight)]);
        }
        let at = |quad: usize| DVec3::from_slice(&self.pose[6 * quad..]);
        let rest = |quad: usize| DVec3::from(self.rig.quads[quad].joint);
        for [i, j] in BONES {
            let bone = at(j) - at(i);
            let length = bone.length().max(f64::MIN_POSITIVE);
            let along = bone / length * self.bones;
            let residual = self.bones * (length - rest(i).distance(rest(j)));
            let row: Vec<_> =
                (0..3).map(|k| (6 + 6 * i + k, -along[k])).chain((0..3).map(|k| (6 + 6 * j + k, along[k]))).collect();
            equations.add(residual, &row);
        }
    }

    fn step(&mut self, step: &[f64]) {
        self.placement = stepped(&self.placement, step);
        self.pose.iter_mut().zip(&step[6..]).for_each(|(y, d)| *y += d);
    }
}

/// Stage (c): the vertices, whose differential coordinates stay those of the quads' cage.
pub(super) struct VertexStage {
    vertices: Vec<Point>,
    /// Uniform Laplacian, by rows.
    laplacian: Vec<Vec<(usize, f64)>>,
    differential: Vec<Point>,
    weight: f64,
}

impl VertexStage {
    pub(super) fn new(height: f64, options: &FitOptions, vertices: Vec<Point>) -> Self {
        let laplacian = laplacian();
        let differential = laplacian.iter().map(|row| sum(row, &vertices)).collect();
        Self { vertices, laplacian, differential, weight: options.vertices / (0.003 * height) }
    }
}

impl Stage for VertexStage {
    fn linearized(&self) -> Linearized {
        Linearized { vertices: self.vertices.clone(), by: By::Vertices }
    }

    fn hold(&self, equations: &mut NormalEquations) {
        for (row, differential) in self.laplacian.iter().zip(&self.differential) {
            let now = sum(row, &self.vertices);
            for k in 0..3 {
                let derivatives: Vec<_> = row.iter().map(|&(v, w)| (3 * v + k, self.weight * w)).collect();
                equations.add(self.weight * (now[k] - differential[k]), &derivatives);
            }
        }
    }

    fn step(&mut self, step: &[f64]) {
        self.vertices.as_flattened_mut().iter_mut().zip(step).for_each(|(x, d)| *x += d);
    }
}

fn sum(row: &[(usize, f64)], vertices: &[Point]) -> Point {
    row.iter().fold([0.0; 3], |sum, &(v, w)| [0, 1, 2].map(|k| sum[k] + w * vertices[v][k]))
}

/// Rows of the uniform Laplacian of a rig's cage, ascending by vertex.
fn laplacian() -> Vec<Vec<(usize, f64)>> {
    let mut around: Vec<BTreeSet<usize>> = (0..CAGE_VERTICES).map(|v| BTreeSet::from([v])).collect();
    for face in triangles() {
        for &a in face {
            around[a as usize].extend(face.iter().map(|&b| b as usize));
        }
    }
    let row = |(v, near): (usize, &BTreeSet<usize>)| {
        let each = -1.0 / (near.len() - 1) as f64;
        near.iter().map(|&w| (w, if w == v { 1.0 } else { each })).collect()
    };
    around.iter().enumerate().map(row).collect()
}
