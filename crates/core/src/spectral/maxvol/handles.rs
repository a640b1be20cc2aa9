//! What a search for rows of maximum volume gives, and what its parts share.

use faer::Mat;
use serde::{Deserialize, Serialize};

/// From this many columns on swaps end at [`LOOSE_TOLERANCE`].
pub(super) const MANY_COLUMNS: usize = 1536;

/// Tolerance for many columns: each swap costs more there, and a basis this well conditioned is enough to interpolate and decompose by.
pub(super) const LOOSE_TOLERANCE: f64 = 1.0;

/// Pivots of LU above this fraction of the largest: far enough from dependent for single precision.
pub(super) const SINGLE_IS_SAFE: f64 = 1e-4;

/// Bound on confirming passes; the growth of the volume keeps their number far below it.
pub(super) const MAX_PASSES: usize = 64;

/// One exchange: the row of the matrix that became a handle, and which handle it replaced.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Swap {
    /// The new row.
    pub row: u32,
    /// Position of the replaced one among the picked rows.
    pub position: u32,
    /// `|B_ij|`, by which the volume grew.
    pub growth: f64,
}

/// How a search went. Stored in reports: the names of fields are part of the format.
#[derive(Clone, Copy, Debug, Default, Deserialize, PartialEq, Serialize)]
#[serde(default)]
pub struct Volume {
    /// Swaps after the start.
    pub swaps: usize,
    /// `ln |det Φ□|`.
    #[serde(deserialize_with = "crate::numbers::number_or_null")]
    pub log_volume: f64,
    /// Largest `|B_ij|` of `Φ = B Φ□` after the last swap.
    #[serde(deserialize_with = "crate::numbers::number_or_null")]
    pub max_entry: f64,
}

/// The handles picked from a tall matrix.
#[derive(Clone, Debug)]
pub struct MaxVol {
    /// Picked rows, one per column of the matrix.
    pub rows: Vec<u32>,
    /// Rows the search started from: those of pivoted LU, or what was given.
    pub start: Vec<u32>,
    /// How the search went; `max_entry` is from a fresh factorisation.
    pub volume: Volume,
    /// The swaps, in order.
    pub trace: Vec<Swap>,
    /// `ln |det Φ□|` of the rows the search started from.
    pub start_log_volume: f64,
    /// `Φ□⁻¹`, m × m.
    pub(crate) inverse: Mat<f64>,
}
