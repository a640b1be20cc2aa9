//! Frames that are multiplied together.

use cager_geometry::linalg::TILE_COLUMNS;

/// Maximum number of frames per matrix product.
pub const BATCH: usize = 16;

/// Columns of the product of a batch of frames.
///
/// Fewer frames take a narrower product. Widths are whole tiles of the kernels, which then sum over the unknowns in the same order (`linalg` has a
/// test for it).
///
/// # Panics
/// Where more frames come than a batch holds.
pub(crate) fn product_columns(frames: usize) -> usize {
    assert!(frames <= BATCH, "at most {BATCH} frames in a batch");
    (3 * frames.max(1)).next_multiple_of(TILE_COLUMNS)
}
