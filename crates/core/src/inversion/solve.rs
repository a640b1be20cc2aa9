//! Inversion of frames: a matrix product per batch, then the consistent inversion if there is one.

use super::consistent::Consistent;
use super::context::PreparationReport;
use super::nearness::Nearness;
use super::{Convergence, RegularizationTarget};
use crate::batch::{BATCH, product_columns};
use crate::decode::Decoder;
use cager_geometry::linalg::{self, BLOCK_ROWS};
use cager_geometry::mesh::Point;
use cager_geometry::spatial::Aabb;
use faer::{Accum, Mat};
use std::sync::Arc;

/// A prepared inversion: `C_t = R · H_t`, plus what the reference cage contributes.
#[derive(Clone, Debug)]
pub struct Solver {
    pub(crate) handles: Vec<u32>,
    pub(crate) reads_all: bool,
    /// `Rᵀ`, K × m, column-major: one row per point read; padded with zero columns to a whole tile.
    pub(crate) operator: Mat<f64>,
    pub(crate) target: RegularizationTarget,
    /// The consistent inversion, where normals are functions of the vertices.
    pub(crate) consistent: Option<Arc<Consistent>>,
    /// Brings cages back to their frames; `None` without a term that holds them.
    pub(crate) nearness: Option<Arc<Nearness>>,
    pub(crate) decoder: Decoder,
    pub(crate) diagonal: f64,
    pub(crate) preparation: PreparationReport,
}

/// What is given of a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Rows {
    /// Every point, n × 3 interleaved.
    All,
    /// Only the points of [`Solver::handles`], K × 3 interleaved.
    Handles,
}

/// The cage of a frame.
#[derive(Clone, Debug, PartialEq)]
pub struct InvertedFrame {
    /// m × 3 interleaved.
    pub cage: Vec<f32>,
    /// Convergence of the consistent inversion, where there is one.
    pub convergence: Option<Convergence>,
    /// Whether it would have left its frame, and was held to the shape of the rest cage.
    pub held: bool,
}

impl Solver {
    /// Results of the preparation.
    pub fn preparation(&self) -> &PreparationReport {
        &self.preparation
    }

    /// Indices of the points read, K, in their order. With [`Handles::All`](super::Handles::All)
    /// every point is read: these are those of maximum volume, or none; for a very large model they
    /// are the sample that is read.
    pub fn handles(&self) -> &[u32] {
        &self.handles
    }

    /// Diagonal of the rest pose's bounding box: the unit of errors.
    pub fn diagonal(&self) -> f64 {
        self.diagonal
    }

    /// The decoder from cages to positions.
    pub fn decoder(&self) -> &Decoder {
        &self.decoder
    }

    /// Bytes the prepared solver holds.
    pub fn size_bytes(&self) -> usize {
        let operator = 8 * self.operator.nrows() * self.operator.ncols() + self.target.size_bytes();
        let consistent = self.consistent.as_ref().map_or(0, |consistent| consistent.size_bytes());
        let nearness = self.nearness.as_ref().map_or(0, |nearness| nearness.size_bytes());
        self.decoder.size_bytes() + operator + consistent + nearness + 4 * self.handles.len()
    }

    /// Whether cages depend on the previous frame's, so that frames have to be inverted in order.
    pub fn follows_previous(&self) -> bool {
        self.target.is_previous()
    }

    /// The cages of frames. Where cages depend on the previous frame, these are consecutive frames,
    /// and `previous` is the cage before them, `None` at the beginning. The cage of a frame is
    /// bit-identical whatever the other frames, and whichever rows are given.
    ///
    /// # Panics
    /// Where lengths do not fit, or the solver reads every point and only handles are given.
    pub fn invert<T: Copy + Into<f64>>(
        &self,
        rows: Rows,
        previous: Option<&[f32]>,
        frames: &[&[T]],
    ) -> Vec<InvertedFrame> {
        assert!(rows == Rows::All || !self.reads_all, "handles are not enough for least squares over all points");
        let (given, every) = match rows {
            Rows::All => (self.decoder.points(), "every frame has every point"),
            Rows::Handles => (self.handles.len(), "every frame has every handle"),
        };
        assert!(frames.iter().all(|f| f.len() == 3 * given), "{every}");
        assert!(previous.is_none_or(|cage| cage.len() == 3 * self.decoder.unknowns()), "a cage has every unknown");
        let is_given = rows == Rows::Handles || self.reads_all;
        let point_of_row = |row: usize| if is_given { row } else { self.handles[row] as usize };
        let mut solved: Vec<InvertedFrame> = Vec::with_capacity(frames.len());
        // Cages that depend on the previous one are finished one by one.
        let together = if self.follows_previous() { 1 } else { BATCH };
        for batch in frames.chunks(BATCH) {
            let (mut cages, boxes) = self.linear(batch, point_of_row);
            let parts = cages.chunks_mut(together).zip(boxes.chunks(together));
            for ((cages, boxes), frames) in parts.zip(batch.chunks(together)) {
                let before = solved.last().map(|inverted| inverted.cage.as_slice()).or(previous);
                let finish_linear = |(cage, around): (&mut Vec<Point>, &Aabb)| {
                    self.target.add(cage, before, self.decoder.positions());
                    self.nearness.as_ref().is_some_and(|nearness| nearness.keep(cage, around, self.diagonal))
                };
                let held: Vec<bool> = cages.iter_mut().zip(boxes).map(finish_linear).collect();
                let position = |frame: usize, row: usize| {
                    let point = point_of_row(row);
                    [0, 1, 2].map(|k| frames[frame][3 * point + k].into())
                };
                let refine =
                    |consistent: &Arc<Consistent>| consistent.refine(&self.decoder, cages, position, self.diagonal);
                let found = self.consistent.as_ref().map(refine);
                let inverted = |(f, cage): (usize, &Vec<Point>)| InvertedFrame {
                    cage: cage.as_flattened().iter().map(|&x| x as f32).collect(),
                    convergence: found.as_ref().map(|found| found[f]),
                    held: held[f],
                };
                solved.extend(cages.iter().enumerate().map(inverted));
            }
        }
        solved
    }

    /// `R · H`, and the box around the points that are read of each frame.
    fn linear<T: Copy + Into<f64>>(
        &self,
        frames: &[&[T]],
        point_of_row: impl Fn(usize) -> usize,
    ) -> (Vec<Vec<Point>>, Vec<Aabb>) {
        let (columns, padded) = self.operator.shape();
        let m = self.decoder.unknowns();
        let width = product_columns(frames.len());
        let mut cages = Mat::<f64>::zeros(padded, width);
        let mut block = Mat::<f64>::zeros(BLOCK_ROWS.min(columns), width);
        let mut read = vec![[0.0; 3]; block.nrows()];
        let mut boxes = vec![Aabb::EMPTY; frames.len()];
        for first in (0..columns).step_by(BLOCK_ROWS) {
            let rows = BLOCK_ROWS.min(columns - first);
            for (f, (frame, around)) in frames.iter().zip(&mut boxes).enumerate() {
                for (i, place) in read[..rows].iter_mut().enumerate() {
                    let point = point_of_row(first + i);
                    *place = [0, 1, 2].map(|k| frame[3 * point + k].into());
                    for k in 0..3 {
                        block[(i, 3 * f + k)] = place[k];
                    }
                }
                *around = around.union(&Aabb::around_all(&read[..rows]));
            }
            let accumulate = if first == 0 { Accum::Replace } else { Accum::Add };
            let operator = self.operator.as_ref().subrows(first, rows).transpose();
            linalg::multiply_add(cages.as_mut(), accumulate, operator, block.as_ref().subrows(0, rows), 1.0);
        }
        let cage = |f: usize| (0..m).map(|j| [0, 1, 2].map(|k| cages[(j, 3 * f + k)])).collect();
        ((0..frames.len()).map(cage).collect(), boxes)
    }
}
