//! Consistent inversion: Gauss–Newton where face normals N(C) are functions of the vertices C.
//!
//! It minimises `E(C) = (v/K) Σ |Φ_v C + Φ_f N(C) − P|² + λ ‖Δ (C − C₀)‖²` over the K points read,
//! with the cage Laplacian Δ over the v vertices. The start and reference C₀ is the cage of a
//! linear inversion with mean value coordinates. λ is positive even without regularisation, so that
//! directions that the points hardly determine stay near C₀.
//!
//! Each step is solved by conjugate gradients, preconditioned by the inverse of `(v/K) Φ_vᵀΦ_v + λ
//! ΔᵀΔ`. A step that does not lower E is halved a few times; if it still does not, it is not taken
//! and the iteration ends, so that E never exceeds its value at C₀. All frames of a batch share the
//! products with `G = (v/K) ΦᵀΦ`; the result of a frame does not depend on the other frames.

mod gram_matrix;
mod state;

pub use state::Outcome;

use crate::batch::{padded_to_tiles, product_columns};
use crate::coordinates::DependentNormals;
use crate::decode::Decoder;
use cager_geometry::linalg::{self, BLOCK_ROWS};
use cager_geometry::mesh::Point;
use cager_geometry::vector::{along, dot, sub};
use faer::{Accum, Mat, MatRef};
use state::{ConjugateGradients, FrameState, products};

/// Maximum number of Gauss–Newton steps per frame.
const MAX_STEPS: usize = 24;
/// Maximum number of conjugate gradient iterations per step.
const MAX_CG_ITERATIONS: usize = 8;
/// A step that lowers E by less than this fraction is the last.
const TOLERANCE: f64 = 1e-3;
/// Maximum number of lengths at which a step is tried, each half of the one before.
const MAX_STEP_TRIALS: usize = 4;
/// Below this fraction of the squared positions, E is at rounding level.
const ROUNDING: f64 = 1e-14;
/// Smallest weight λ; the regularisation is negligible there.
const MIN_WEIGHT: f64 = 1e-9;

/// How the inversion of one frame went.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Convergence {
    /// Gauss–Newton steps taken.
    pub steps: usize,
    /// Root mean square distance of the points read for the linear start, over the rest diagonal.
    pub start: f64,
    /// The same for the resulting cage.
    pub residual: f64,
    /// How it ended.
    pub outcome: Outcome,
}

/// Consistent inversion, prepared for the points that a solver reads.
#[derive(Clone, Debug)]
pub(crate) struct Consistent {
    /// `G`, T × T for T = v + f; padded with zero columns to a whole tile.
    gram: Mat<f64>,
    /// `G` plus `λ ΔᵀΔ` in the block of the vertices; padded with zero rows to a whole tile.
    curvature: Mat<f32>,
    /// Inverse of the block of the vertices, v × v; padded likewise.
    preconditioner: Mat<f32>,
    /// Rows read of Φ, K × T; none where every point is read.
    rows: Option<Mat<f64>>,
    /// Neighbours of each vertex.
    neighbours: Vec<Vec<u32>>,
    /// λ.
    weight: f64,
    /// v/K.
    share: f64,
}

impl Consistent {
    /// `G` of the given rows, or of all points for `None`.
    pub(crate) fn gram_of(decoder: &Decoder, rows: Option<&[u32]>) -> Mat<f64> {
        gram_matrix::gram(decoder, rows, share(decoder, rows))
    }

    /// Prepares the inversion from [`Self::gram_of`] the same points. `None` where the
    /// factorisation fails, or normals are not functions of the vertices.
    pub(crate) fn from_gram(decoder: &Decoder, rows: Option<&[u32]>, weight: f64, gram: Mat<f64>) -> Option<Self> {
        let neighbours = neighbours(decoder.dependent_normals()?, decoder.positions());
        let (v, total) = (decoder.positions(), decoder.columns());
        if gram.shape() != (total, total) {
            return None;
        }
        let weight = weight.max(MIN_WEIGHT);
        let mut system = gram.submatrix(0, 0, v, v).to_owned();
        let size = (0..v).map(|i| system[(i, i)]).fold(0.0, f64::max);
        for (i, near) in neighbours.iter().enumerate() {
            system[(i, i)] += 1e-12 * size;
            // Row i of Δ, once for each pair of its entries.
            let entries =
                || std::iter::once((i, 1.0)).chain(near.iter().map(|&j| (j as usize, -1.0 / near.len() as f64)));
            for (a, x) in entries() {
                for (b, y) in entries() {
                    system[(a, b)] += weight * x * y;
                }
            }
        }
        let preconditioner = linalg::solve_definite(system.clone(), Mat::identity(v, v))?;
        let mut curvature = gram.clone();
        curvature.submatrix_mut(0, 0, v, v).copy_from(&system);
        let single = |a: &Mat<f64>| linalg::to_single(a.as_ref(), a.nrows().next_multiple_of(linalg::TILE_ROWS));
        Some(Self {
            gram: padded_to_tiles(gram),
            curvature: single(&curvature),
            preconditioner: single(&preconditioner),
            rows: rows.map(|rows| padded_to_tiles(linalg::to_double(decoder.rows(rows).as_ref()))),
            neighbours,
            weight,
            share: share(decoder, rows),
        })
    }

    /// `G`, T × T.
    pub(crate) fn gram(&self) -> MatRef<'_, f64> {
        self.gram.as_ref().subcols(0, self.gram.nrows())
    }

    /// λ.
    pub(crate) fn weight(&self) -> f64 {
        self.weight
    }

    pub(crate) fn size_bytes(&self) -> usize {
        let doubles = |a: &Mat<f64>| 8 * a.nrows() * a.ncols();
        let singles = |a: &Mat<f32>| 4 * a.nrows() * a.ncols();
        let rows = self.rows.as_ref().map_or(0, doubles);
        doubles(&self.gram) + singles(&self.curvature) + singles(&self.preconditioner) + rows
    }

    /// Refines the cages of a batch in place. `point(f, i)` is the i-th point read of frame f;
    /// distances are over `diagonal`.
    pub(crate) fn refine(
        &self,
        decoder: &Decoder,
        cages: &mut [Vec<Point>],
        point: impl Fn(usize, usize) -> Point,
        diagonal: f64,
    ) -> Vec<Convergence> {
        let Some(dependent) = decoder.dependent_normals() else { return Vec::new() };
        let mut frames: Vec<FrameState> = cages.iter().map(|cage| FrameState::new(cage)).collect();
        self.read(decoder, &mut frames, point);
        let values: Vec<Vec<Point>> = frames.iter().map(|frame| frame.values(dependent, &frame.cage)).collect();
        for (frame, (values, products)) in frames.iter_mut().zip(values.iter().zip(self.gram_product(&values))) {
            frame.energy = frame.data_energy(values, &products);
            frame.start_energy = frame.energy;
            frame.products = products;
        }
        for _ in 0..MAX_STEPS {
            for frame in frames.iter_mut().filter(|frame| frame.outcome.is_none()) {
                if frame.energy <= ROUNDING * frame.squared_positions {
                    frame.outcome = Some(Outcome::Converged);
                }
            }
            let mut open: Vec<&mut FrameState> = frames.iter_mut().filter(|frame| frame.outcome.is_none()).collect();
            if open.is_empty() {
                break;
            }
            let steps = self.steps(dependent, &open);
            self.line_search(dependent, &mut open, &steps);
        }
        let vertices = decoder.positions() as f64;
        let length = |energy: f64| (energy.max(0.0) / vertices).sqrt() / diagonal;
        let convergence = |(frame, cage): (&FrameState, &mut Vec<Point>)| {
            frame.write(cage);
            Convergence {
                steps: frame.steps,
                start: length(frame.start_energy),
                residual: length(frame.energy - self.regularization_energy(frame, &frame.cage)),
                outcome: frame.outcome.unwrap_or(Outcome::StepLimit),
            }
        };
        frames.iter().zip(cages).map(convergence).collect()
    }

    /// Right-hand sides `(v/K) Φᵀ P`, and `(v/K) Σ |P|²`.
    fn read(&self, decoder: &Decoder, frames: &mut [FrameState], point: impl Fn(usize, usize) -> Point) {
        let read = self.rows.as_ref().map_or(decoder.points(), Mat::nrows);
        let (total, width) = (self.gram.nrows(), product_columns(frames.len()));
        let padded = self.gram.ncols();
        let mut sides = Mat::<f64>::zeros(padded, width);
        let mut block = Mat::<f64>::zeros(BLOCK_ROWS.min(read), width);
        let mut converted = Mat::<f64>::zeros(if self.rows.is_some() { 0 } else { BLOCK_ROWS.min(read) }, padded);
        for first in (0..read).step_by(BLOCK_ROWS) {
            let count = BLOCK_ROWS.min(read - first);
            for (f, frame) in frames.iter_mut().enumerate() {
                for i in 0..count {
                    let p = sub(point(f, first + i), frame.origin);
                    frame.squared_positions += self.share * dot(p, p);
                    for k in 0..3 {
                        block[(i, 3 * f + k)] = self.share * p[k];
                    }
                }
            }
            let rows = match &self.rows {
                Some(rows) => rows.as_ref().subrows(first, count),
                None => {
                    gram_matrix::convert(decoder, first, count, &mut converted);
                    converted.as_ref().subrows(0, count)
                }
            };
            let accumulate = if first == 0 { Accum::Replace } else { Accum::Add };
            let block = block.as_ref().subrows(0, count);
            linalg::multiply_add(sides.as_mut(), accumulate, rows.transpose(), block, 1.0);
        }
        for (f, frame) in frames.iter_mut().enumerate() {
            frame.right_hand_side = (0..total).map(|j| [0, 1, 2].map(|k| sides[(j, 3 * f + k)])).collect();
        }
    }

    /// The Gauss–Newton step of each frame.
    fn steps(&self, dependent: &DependentNormals, frames: &[&mut FrameState]) -> Vec<Vec<Point>> {
        let start = |frame: &&mut FrameState| {
            let gradient = self.apply_regularization(&frame.displacement(&frame.cage));
            ConjugateGradients::new(dependent, frame, &gradient)
        };
        let mut searches: Vec<ConjugateGradients> = frames.iter().map(start).collect();
        for iteration in 0..MAX_CG_ITERATIONS {
            let mut open: Vec<_> = searches.iter_mut().filter(|search| !search.done).collect();
            let residuals: Vec<&[Point]> = open.iter().map(|search| search.residual.as_slice()).collect();
            let preconditioned = products(self.preconditioner.as_ref(), &residuals, |x| x as f32, f64::from);
            for (search, preconditioned) in open.iter_mut().zip(preconditioned) {
                search.update_direction(&preconditioned, iteration == 0);
            }
            open.retain(|search| !search.done);
            if open.is_empty() {
                break;
            }
            let moved: Vec<Vec<Point>> = open.iter().map(|search| search.jacobian_product(dependent)).collect();
            let products = products(self.curvature.as_ref(), &moved, |x| x as f32, f64::from);
            for (search, products) in open.into_iter().zip(products) {
                search.advance(dependent, &products);
            }
        }
        searches.into_iter().map(|search| search.step).collect()
    }

    /// Backtracking line search: takes each step, halved until it lowers E.
    fn line_search(&self, dependent: &DependentNormals, frames: &mut [&mut FrameState], steps: &[Vec<Point>]) {
        let mut length = 1.0;
        let mut open: Vec<(&mut &mut FrameState, &Vec<Point>)> = frames.iter_mut().zip(steps).collect();
        for _ in 0..MAX_STEP_TRIALS {
            let trial = |(frame, step): &(&mut &mut FrameState, &Vec<Point>)| {
                let cage: Vec<Point> = frame.cage.iter().zip(*step).map(|(c, s)| along(*c, length, *s)).collect();
                let values = frame.values(dependent, &cage);
                (cage, values)
            };
            let (moved, values): (Vec<_>, Vec<_>) = open.iter().map(trial).unzip();
            let mut trials = moved.into_iter().zip(self.gram_product(&values)).zip(&values);
            open.retain_mut(|(frame, _)| {
                let Some(((cage, products), values)) = trials.next() else { return true };
                let energy = frame.data_energy(values, &products) + self.regularization_energy(frame, &cage);
                if energy < frame.energy {
                    frame.steps += 1;
                    if frame.energy - energy < TOLERANCE * energy {
                        frame.outcome = Some(Outcome::Converged);
                    }
                    (frame.cage, frame.products, frame.energy) = (cage, products, energy);
                    return false;
                }
                true
            });
            length *= 0.5;
        }
        for (frame, _) in open {
            frame.outcome = Some(if frame.steps == 0 { Outcome::KeptStart } else { Outcome::Converged });
        }
    }

    fn gram_product(&self, values: &[Vec<Point>]) -> Vec<Vec<Point>> {
        products(self.gram.transpose(), values, |x| x, |x| x)
    }

    /// `Δ x`.
    fn laplacian(&self, x: &[Point]) -> Vec<Point> {
        let of_vertex = |(i, near): (usize, &Vec<u32>)| {
            let share = 1.0 / near.len() as f64;
            [0, 1, 2].map(|k| x[i][k] - share * near.iter().map(|&j| x[j as usize][k]).sum::<f64>())
        };
        self.neighbours.iter().enumerate().map(of_vertex).collect()
    }

    /// `λ ΔᵀΔ x`.
    fn apply_regularization(&self, x: &[Point]) -> Vec<Point> {
        let laplacian = self.laplacian(x);
        let mut out: Vec<Point> = laplacian.clone();
        for (near, b) in self.neighbours.iter().zip(&laplacian) {
            for &j in near {
                for k in 0..3 {
                    out[j as usize][k] -= b[k] / near.len() as f64;
                }
            }
        }
        out.into_iter().map(|x| x.map(|c| self.weight * c)).collect()
    }

    fn regularization_energy(&self, frame: &FrameState, cage: &[Point]) -> f64 {
        self.weight * self.laplacian(&frame.displacement(cage)).iter().map(|&b| dot(b, b)).sum::<f64>()
    }
}

/// v/K.
fn share(decoder: &Decoder, rows: Option<&[u32]>) -> f64 {
    decoder.positions() as f64 / rows.map_or(decoder.points(), <[u32]>::len) as f64
}

/// Neighbours of each vertex, each once: an edge's two faces run along it in opposite directions.
fn neighbours(dependent: &DependentNormals, vertices: usize) -> Vec<Vec<u32>> {
    let mut neighbours = vec![Vec::new(); vertices];
    for &[a, b, c] in dependent.faces() {
        for (from, to) in [(a, b), (b, c), (c, a)] {
            neighbours[from as usize].push(to);
        }
    }
    neighbours
}
