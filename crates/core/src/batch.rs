//! Frames that are multiplied together.

use cager_geometry::linalg::{TILE_COLUMNS, TILE_ROWS};
use faer::Mat;

/// Maximum number of frames per matrix product.
pub const BATCH: usize = 16;

/// Columns of the product of a batch of frames: whole tiles, in which the kernels sum in the same
/// order for any number of frames.
pub(crate) fn product_columns(frames: usize) -> usize {
    assert!(frames <= BATCH, "at most {BATCH} frames in a batch");
    (3 * frames.max(1)).next_multiple_of(TILE_COLUMNS)
}

/// Zero columns up to a whole tile, as for [`product_columns`].
pub(crate) fn padded_to_tiles(mut a: Mat<f64>) -> Mat<f64> {
    a.resize_with(a.nrows(), a.ncols().next_multiple_of(TILE_ROWS), |_, _| 0.0);
    a
}
