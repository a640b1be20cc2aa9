//! Inversion of frames: one matrix product per batch, followed by the consistent inversion where normals are functions of the vertices.

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

/// A prepared inversion: `C_t = R · H_t`, plus a constant or a linear function of the previous cage for some terms.
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

    /// Indices of the points read, K, in the order in which they are read. With [`Handles::All`](super::Handles::All) every point is
    /// read: these are those of maximum volume, or none where no handles were chosen; for a very large model they are its sample, and no
    /// other point is read.
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

    /// Whether every cage depends on the previous frame's, so that frames have to be inverted in order.
    pub fn follows_previous(&self) -> bool {
        self.target.is_previous()
    }

    /// The cages of frames, in batches of [`BATCH`]. Where cages depend on the previous frame, these are consecutive frames, and `previous` is the
    /// cage of the frame before them, `None` at the beginning. Other solvers ignore it.
    ///
    /// The cage of a frame is bit-identical whatever the other frames, and whichever rows are given.
    ///
    /// # Panics
    /// Where lengths do not fit, or the solver reads every point and only handles are given.
    pub fn invert<T: Copy + Into<f64>>(
        &self,
        rows: Rows,
        previous: Option<&[f32]>,
        frames: &[&[T]],
    ) -> Vec<InvertedFrame> {
        let mut solved: Vec<InvertedFrame> = Vec::with_capacity(frames.len());
        for batch in frames.chunks(BATCH) {
            let before = solved.last().map(|inverted| inverted.cage.as_slice()).or(previous);
            let batch = self.invert_batch(rows, before, batch);
            solved.extend(batch);
        }
        solved
    }

    fn invert_batch<T: Copy + Into<f64>>(
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
        let is_given = rows == Rows::Handles || self.reads_all;
        let point_of_row = |row: usize| if is_given { row } else { self.handles[row] as usize };
        assert!(previous.is_none_or(|cage| cage.len() == 3 * self.decoder.unknowns()), "a cage has every unknown");
        let (mut cages, boxes) = self.linear(frames, point_of_row);
        let position = |frame: usize, row: usize| {
            let point = point_of_row(row);
            [0, 1, 2].map(|k| frames[frame][3 * point + k].into())
        };
        if let (Some(consistent), false) = (&self.consistent, self.follows_previous()) {
            let mut held = Vec::with_capacity(frames.len());
            for (cage, around) in cages.iter_mut().zip(&boxes) {
                self.target.add(cage, None, self.decoder.positions());
                held.push(self.keep_near(cage, around));
            }
            let found = consistent.refine(&self.decoder, &mut cages, position, self.diagonal);
            let inverted = |((cage, found), held): ((&Vec<Point>, _), bool)| InvertedFrame {
                cage: single(cage),
                convergence: Some(found),
                held,
            };
            return cages.iter().zip(found).zip(held).map(inverted).collect();
        }
        let mut solved: Vec<InvertedFrame> = Vec::with_capacity(frames.len());
        for (f, (mut cage, around)) in cages.into_iter().zip(&boxes).enumerate() {
            let before = solved.last().map(|inverted| inverted.cage.as_slice()).or(previous);
            self.target.add(&mut cage, before, self.decoder.positions());
            let held = self.keep_near(&mut cage, around);
            let mut cage = [cage];
            let refine = |consistent: &Arc<Consistent>| {
                consistent.refine(&self.decoder, &mut cage, |_, row| position(f, row), self.diagonal).pop()
            };
            let convergence = self.consistent.as_ref().and_then(refine);
            solved.push(InvertedFrame { cage: single(&cage[0]), convergence, held });
        }
        solved
    }

    fn keep_near(&self, cage: &mut [Point], around: &Aabb) -> bool {
        self.nearness.as_ref().is_some_and(|nearness| nearness.keep(cage, around, self.diagonal))
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
        let mut first = 0;
        while first < columns {
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
            linalg::multiply_add(
                cages.as_mut(),
                if first == 0 { Accum::Replace } else { Accum::Add },
                self.operator.as_ref().subrows(first, rows).transpose(),
                block.as_ref().subrows(0, rows),
                1.0,
            );
            first += rows;
        }
        let cage = |f: usize| (0..m).map(|j| [0, 1, 2].map(|k| cages[(j, 3 * f + k)])).collect();
        ((0..frames.len()).map(cage).collect(), boxes)
    }
}

fn single(cage: &[Point]) -> Vec<f32> {
    cage.as_flattened().iter().map(|&x| x as f32).collect()
}

/// Zero columns up to a whole tile, see `product_columns`.
pub(crate) fn padded_to_tiles(mut operator: Mat<f64>) -> Mat<f64> {
    operator.resize_with(operator.nrows(), operator.ncols().next_multiple_of(linalg::TILE_ROWS), |_, _| 0.0);
    operator
}
