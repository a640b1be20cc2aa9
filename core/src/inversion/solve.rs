//! Cages from frames: one matrix product for a batch.

use super::{BLOCK_ROWS, Preparation};
use crate::decode::Decoder;
use faer::{Accum, Mat, Par};

/// Most frames of one matrix product.
pub const BATCH: usize = 16;

/// A prepared inversion: `C_t = R · H_t`.
#[derive(Clone, Debug)]
pub struct Solver {
    pub(super) handles: Vec<u32>,
    pub(super) reads_all: bool,
    /// `Rᵀ`, K × m, column-major: one row per point read; zero columns follow up to a whole tile.
    pub(super) operator: Mat<f64>,
    pub(super) decoder: Decoder,
    pub(super) diagonal: f64,
    pub(super) preparation: Preparation,
}

impl Solver {
    /// What preparing found out.
    pub fn preparation(&self) -> &Preparation {
        &self.preparation
    }

    /// Rows of maximum volume. With [`Handles::All`] they only condition the solve, and every point is read.
    pub fn handles(&self) -> &[u32] {
        &self.handles
    }

    /// Diagonal of the rest pose's bounding box: the unit of errors.
    pub fn diagonal(&self) -> f64 {
        self.diagonal
    }

    /// Cages back to positions.
    pub fn decoder(&self) -> &Decoder {
        &self.decoder
    }

    /// Bytes the prepared solver holds.
    pub fn size_bytes(&self) -> usize {
        let phi = self.decoder.coordinates();
        4 * phi.nrows() * phi.ncols() + 8 * self.operator.nrows() * self.operator.ncols() + 4 * self.handles.len()
    }

    /// Cages, each m × 3 interleaved, of up to [`BATCH`] frames, each n × 3 interleaved.
    ///
    /// The bits of a cage depend on its frame alone, not on the other frames of the batch.
    ///
    /// # Panics
    /// Where a frame's length does not fit, or more frames come than a batch holds.
    pub fn invert<T: Copy + Into<f64>>(&self, frames: &[&[T]]) -> Vec<Vec<f32>> {
        assert!(frames.iter().all(|f| f.len() == 3 * self.decoder.points()), "every frame has every point");
        self.solve(frames, |row| if self.reads_all { row } else { self.handles[row] as usize })
    }

    /// As [`Self::invert`] of frames of which only the rows of [`Self::handles`] are there, K × 3 interleaved: the same bits.
    ///
    /// # Panics
    /// As [`Self::invert`], and where the solver reads every point.
    pub fn invert_handles<T: Copy + Into<f64>>(&self, frames: &[&[T]]) -> Vec<Vec<f32>> {
        assert!(!self.reads_all, "handles are not enough for least squares over all points");
        assert!(frames.iter().all(|f| f.len() == 3 * self.handles.len()), "every frame has every handle");
        self.solve(frames, |row| row)
    }

    fn solve<T: Copy + Into<f64>>(&self, frames: &[&[T]], point_of_row: impl Fn(usize) -> usize) -> Vec<Vec<f32>> {
        let (columns, padded) = self.operator.shape();
        let m = self.decoder.unknowns();
        let width = product_columns(frames.len());
        let mut cages = Mat::<f64>::zeros(padded, width);
        let mut block = Mat::<f64>::zeros(BLOCK_ROWS.min(columns), width);
        let mut first = 0;
        while first < columns {
            let rows = BLOCK_ROWS.min(columns - first);
            for (f, frame) in frames.iter().enumerate() {
                for i in 0..rows {
                    let point = point_of_row(first + i);
                    for k in 0..3 {
                        block[(i, 3 * f + k)] = frame[3 * point + k].into();
                    }
                }
            }
            faer::linalg::matmul::matmul(
                cages.as_mut(),
                if first == 0 { Accum::Replace } else { Accum::Add },
                self.operator.as_ref().subrows(first, rows).transpose(),
                block.as_ref().subrows(0, rows),
                1.0,
                Par::Seq,
            );
            first += rows;
        }
        (0..frames.len())
            .map(|f| (0..m).flat_map(|j| [0, 1, 2].map(|k| cages[(j, 3 * f + k)] as f32)).collect())
            .collect()
    }
}

/// Columns of the product of a batch of frames.
///
/// Few frames cost less in a narrow product. Widths are whole tiles of the kernels, which sum over the unknowns in the same
/// order in each: a test holds them to it.
///
/// # Panics
/// Where more frames come than a batch holds.
pub(crate) fn product_columns(frames: usize) -> usize {
    assert!(frames <= BATCH, "at most {BATCH} frames in a batch");
    3 * [BATCH / 4, BATCH / 2].into_iter().find(|&width| frames <= width).unwrap_or(BATCH)
}
