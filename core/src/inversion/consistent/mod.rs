//! The inversion of coordinates whose normals follow from the cage's vertices: `min ‖Φ_v C + Φ_f N(C) − P‖²` over the points
//! read.
//!
//! It starts from the cage `C₀` of a linear inversion, that of mean value coordinates, which lies close and has no folded faces, and keeps the
//! shape that it has as far as the points leave it open. Where the points alone count, λ is small, and `C₀` is regularised all the same in directions
//! that they hardly determine: from a wild cage the steps end in a worse minimum.
//!
//! `E(C) = (v/K) Σ |Φ_v C + Φ_f N(C) − P|² + λ ‖Δ (C − C₀)‖²`, with the cage Laplacian Δ over v vertices and K points read.
//!
//! Gauss–Newton steps minimise it, each solved by conjugate gradients that `(v/K) Φ_vᵀΦ_v + λ ΔᵀΔ` preconditions. A step that
//! does not lower E is shortened, and then left out, so that the points read are never worse reproduced than by `C₀`. The fixed
//! point `C ← R (P − Φ_f N(C))` does not converge on real captures: where normals and vertices move the model against each
//! other its contraction is close to one, and folds of the cage keep it moving. Free Green coordinates are no place to
//! start from either: their cages have spikes a quarter of the model long.
//!
//! All frames of a batch share the products with `G = (v/K) ΦᵀΦ`; everything else is a frame's own, so that its bits depend on no other.

mod state;
mod sums;

use crate::coordinates::TiedNormals;
use crate::decode::Decoder;
use crate::dense;
use crate::mesh::Point;
use faer::{Accum, Mat, MatRef, Par};
use state::{Moving, dot};

use super::{BLOCK_ROWS, product_columns};

/// Most Gauss–Newton steps of a frame.
const STEPS: usize = 24;
/// Most conjugate gradients of a step.
const GRADIENTS: usize = 8;
/// Fraction of the first preconditioned squared residual at which gradients have converged.
const GRADIENT_TOLERANCE: f64 = 1e-4;
/// A step that lowers E by less than this fraction is the last.
const TOLERANCE: f64 = 1e-3;
/// Steps are halved so often before they are left out.
const HALVINGS: usize = 4;
/// Below this fraction of the squared positions, E is rounding.
const ROUNDING: f64 = 1e-14;
/// The smallest weight λ, beside which nothing of the shape's is left.
const LEAST_WEIGHT: f64 = 1e-9;

/// How the inversion of one frame went.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Convergence {
    /// Gauss–Newton steps taken.
    pub steps: usize,
    /// Root of the mean square distance of the points read over the rest diagonal, as the linear start leaves it.
    pub start: f64,
    /// The same, of the cage found.
    pub residual: f64,
    /// How it ended.
    pub outcome: Outcome,
}

/// How the inversion of one frame ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// The last step changed next to nothing, or no further one was an improvement.
    Converged,
    /// As many steps were taken as are allowed, and each was an improvement.
    StepLimit,
    /// No step was an improvement: the cage is the linear start's.
    KeptStart,
}

/// Prepared for the points that a solver reads.
#[derive(Clone, Debug)]
pub(crate) struct Consistent {
    /// `G`, T × T for T = v + f; zero columns follow up to a whole tile, as in all of these.
    gram: Mat<f64>,
    /// `G`, and among vertices `λ ΔᵀΔ` beside it, for the conjugate gradients; zero rows follow up to a whole tile.
    curvature: Mat<f32>,
    /// The inverse of its part among vertices, v × v; zero rows follow as well.
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
    /// `G` of the points read: the given rows, or where there are none, all.
    pub(crate) fn gram_of(decoder: &Decoder, rows: Option<&[u32]>) -> Mat<f64> {
        let read = rows.map_or(decoder.points(), <[u32]>::len);
        sums::gram(decoder, rows, decoder.positions() as f64 / read as f64)
    }

    /// For the same points, with their [`Self::gram_of`]. `None` where no factorisation succeeds, or where normals are not tied.
    pub(crate) fn from_gram(decoder: &Decoder, rows: Option<&[u32]>, weight: f64, gram: Mat<f64>) -> Option<Self> {
        let neighbours = neighbours(decoder.tied_normals()?, decoder.positions());
        let (v, total) = (decoder.positions(), decoder.columns());
        if gram.shape() != (total, total) {
            return None;
        }
        let weight = weight.max(LEAST_WEIGHT);
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
        let preconditioner = dense::solve_definite(system.clone(), Mat::identity(v, v))?;
        let curvature = |i, j| if i < v && j < v { system[(i, j)] } else { gram[(i, j)] };
        let curvature = single(total, &curvature);
        let preconditioner = single(v, &|i, j| preconditioner[(i, j)]);
        let whole = |mut a: Mat<f64>| {
            let columns = a.ncols().next_multiple_of(dense::WHOLE_ROWS);
            a.resize_with(a.nrows(), columns, |_, _| 0.0);
            a
        };
        Some(Self {
            gram: whole(gram),
            curvature,
            preconditioner,
            rows: rows.map(|rows| whole(sums::rows_of(decoder, rows))),
            neighbours,
            weight,
            share: v as f64 / rows.map_or(decoder.points(), <[u32]>::len) as f64,
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

    /// Improves the cages of a batch in place. `point` gives row i of those read of frame f; `diagonal` is the unit of what is
    /// reported.
    pub(crate) fn refine(
        &self,
        decoder: &Decoder,
        cages: &mut [Vec<Point>],
        point: impl Fn(usize, usize) -> Point,
        diagonal: f64,
    ) -> Vec<Convergence> {
        let Some(tied) = decoder.tied_normals() else { return Vec::new() };
        let mut frames: Vec<Moving> = cages.iter().map(|cage| Moving::new(cage)).collect();
        self.read(decoder, &mut frames, point);
        let values: Vec<Vec<Point>> = frames.iter().map(|frame| frame.values(tied, &frame.cage)).collect();
        for (frame, (values, products)) in frames.iter_mut().zip(values.iter().zip(self.times_gram(&values))) {
            frame.energy = frame.data_energy(values, &products);
            frame.start_energy = frame.energy;
            frame.products = products;
        }
        for _ in 0..STEPS {
            for frame in frames.iter_mut().filter(|frame| frame.outcome.is_none()) {
                if frame.energy <= ROUNDING * frame.squares {
                    frame.outcome = Some(Outcome::Converged);
                }
            }
            if frames.iter().all(|frame| frame.outcome.is_some()) {
                break;
            }
            let steps = self.steps(tied, &frames);
            self.walk(tied, &mut frames, &steps);
        }
        let vertices = decoder.positions() as f64;
        let length = |energy: f64| (energy.max(0.0) / vertices).sqrt() / diagonal;
        for (frame, cage) in frames.iter().zip(cages.iter_mut()) {
            frame.write(cage);
        }
        frames
            .iter()
            .map(|frame| Convergence {
                steps: frame.steps,
                start: length(frame.start_energy),
                residual: length(frame.energy - self.shape_energy(frame, &frame.cage)),
                outcome: frame.outcome.unwrap_or(Outcome::StepLimit),
            })
            .collect()
    }

    /// Right-hand sides `(v/K) Φᵀ P`, and the squares of the positions.
    fn read(&self, decoder: &Decoder, frames: &mut [Moving], point: impl Fn(usize, usize) -> Point) {
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
                    let p = point(f, first + i);
                    let p = [0, 1, 2].map(|k| p[k] - frame.origin[k]);
                    frame.squares += self.share * dot(p, p);
                    for k in 0..3 {
                        block[(i, 3 * f + k)] = self.share * p[k];
                    }
                }
            }
            let rows = match &self.rows {
                Some(rows) => rows.as_ref().subrows(first, count),
                None => {
                    sums::convert(decoder, first, count, &mut converted);
                    converted.as_ref().subrows(0, count)
                }
            };
            let accumulate = if first == 0 { Accum::Replace } else { Accum::Add };
            let block = block.as_ref().subrows(0, count);
            faer::linalg::matmul::matmul(sides.as_mut(), accumulate, rows.transpose(), block, 1.0, Par::Seq);
        }
        for (f, frame) in frames.iter_mut().enumerate() {
            frame.side = (0..total).map(|j| [0, 1, 2].map(|k| sides[(j, 3 * f + k)])).collect();
        }
    }

    /// The Gauss–Newton step of each frame that still moves.
    fn steps(&self, tied: &TiedNormals, frames: &[Moving]) -> Vec<Vec<Point>> {
        let mut searches: Vec<_> = frames
            .iter()
            .map(|frame| frame.outcome.is_none().then(|| state::Search::new(tied, frame, &self.pull_back(frame))))
            .collect();
        for gradient in 0..GRADIENTS {
            let residuals: Vec<Vec<Point>> =
                searches.iter().map(|s| active(s).map_or(Vec::new(), state::Search::residual)).collect();
            let better = state::products(self.preconditioner.as_ref(), &residuals, |x| x as f32, f64::from);
            for (search, better) in searches.iter_mut().zip(better) {
                if let Some(search) = search {
                    search.turn(&better, gradient == 0, GRADIENT_TOLERANCE);
                }
            }
            if searches.iter().flatten().all(state::Search::is_done) {
                break;
            }
            let moved: Vec<Vec<Point>> =
                searches.iter().map(|s| active(s).map_or(Vec::new(), |s| s.moved_values(tied))).collect();
            let products = state::products(self.curvature.as_ref(), &moved, |x| x as f32, f64::from);
            for (search, products) in searches.iter_mut().zip(products) {
                if let Some(search) = search {
                    search.advance(tied, &products);
                }
            }
        }
        searches.into_iter().map(|search| search.map_or(Vec::new(), state::Search::into_step)).collect()
    }

    /// Takes the steps as far as they lower E.
    fn walk(&self, tied: &TiedNormals, frames: &mut [Moving], steps: &[Vec<Point>]) {
        let mut length = 1.0;
        let mut waiting: Vec<bool> = frames.iter().map(|frame| frame.outcome.is_none()).collect();
        for _ in 0..HALVINGS {
            let trials: Vec<(Vec<Point>, Vec<Point>)> = frames
                .iter()
                .zip(steps)
                .zip(&waiting)
                .map(|((frame, step), &waits)| {
                    if !waits {
                        return Default::default();
                    }
                    let moved = |(c, s): (&Point, &Point)| [0, 1, 2].map(|k| c[k] + length * s[k]);
                    let cage: Vec<Point> = frame.cage.iter().zip(step).map(moved).collect();
                    let values = frame.values(tied, &cage);
                    (cage, values)
                })
                .collect();
            let (moved, values): (Vec<_>, Vec<_>) = trials.into_iter().unzip();
            let products = self.times_gram(&values);
            for (f, (cage, products)) in moved.into_iter().zip(products).enumerate() {
                let frame = &mut frames[f];
                if !waiting[f] {
                    continue;
                }
                let energy = frame.data_energy(&values[f], &products) + self.shape_energy(frame, &cage);
                if energy < frame.energy {
                    waiting[f] = false;
                    frame.steps += 1;
                    if frame.energy - energy < TOLERANCE * energy {
                        frame.outcome = Some(Outcome::Converged);
                    }
                    (frame.cage, frame.products, frame.energy) = (cage, products, energy);
                }
            }
            if !waiting.contains(&true) {
                return;
            }
            length *= 0.5;
        }
        for (frame, waits) in frames.iter_mut().zip(waiting) {
            if waits {
                frame.outcome = Some(if frame.steps == 0 { Outcome::KeptStart } else { Outcome::Converged });
            }
        }
    }

    fn times_gram(&self, values: &[Vec<Point>]) -> Vec<Vec<Point>> {
        state::products(self.gram.transpose(), values, |x| x, |x| x)
    }

    /// `Δ x`.
    fn bent(&self, x: &[Point]) -> Vec<Point> {
        let of_vertex = |(i, near): (usize, &Vec<u32>)| {
            let share = 1.0 / near.len() as f64;
            [0, 1, 2].map(|k| x[i][k] - share * near.iter().map(|&j| x[j as usize][k]).sum::<f64>())
        };
        self.neighbours.iter().enumerate().map(of_vertex).collect()
    }

    /// `λ ΔᵀΔ x`.
    fn shape_gradient(&self, x: &[Point]) -> Vec<Point> {
        let bent = self.bent(x);
        let mut out: Vec<Point> = bent.clone();
        for (near, b) in self.neighbours.iter().zip(&bent) {
            for &j in near {
                for k in 0..3 {
                    out[j as usize][k] -= b[k] / near.len() as f64;
                }
            }
        }
        out.into_iter().map(|x| x.map(|c| self.weight * c)).collect()
    }

    fn shape_energy(&self, frame: &Moving, cage: &[Point]) -> f64 {
        self.weight * self.bent(&frame.moved_by(cage)).iter().map(|&b| dot(b, b)).sum::<f64>()
    }

    fn pull_back(&self, frame: &Moving) -> Vec<Point> {
        self.shape_gradient(&frame.moved_by(&frame.cage))
    }
}

/// A search that goes on.
fn active(search: &Option<state::Search>) -> Option<&state::Search> {
    search.as_ref().filter(|search| !search.is_done())
}

/// Square, in single precision, with zero rows up to a whole tile.
fn single(n: usize, entry: &dyn Fn(usize, usize) -> f64) -> Mat<f32> {
    Mat::from_fn(n.next_multiple_of(dense::WHOLE_ROWS), n, |i, j| if i < n { entry(i, j) as f32 } else { 0.0 })
}

/// Neighbours of each vertex of a closed mesh: along every edge, one of its two faces runs away from the vertex.
fn neighbours(tied: &TiedNormals, vertices: usize) -> Vec<Vec<u32>> {
    let mut neighbours = vec![Vec::new(); vertices];
    for &[a, b, c] in tied.faces() {
        for (from, to) in [(a, b), (b, c), (c, a)] {
            neighbours[from as usize].push(to);
        }
    }
    neighbours
}
