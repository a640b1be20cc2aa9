//! Handles drawn at random against those of maximum volume (the paper's Fig. 3).

use crate::evaluation::Totals;
use crate::noise::Random;
use serde::Serialize;

pub(crate) const DRAWS: u64 = 10;

/// Frames at which draws are measured where inversions iterate, which would take most of the time.
pub(crate) const DRAW_FRAMES: usize = 6;

/// One choice of as many points as unknowns.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct Draw {
    pub(crate) choice: String,
    pub(crate) rank: usize,
    /// Condition number of their rows; of dependent ones, what rounding makes of it.
    pub(crate) condition: f64,
    /// Errors and spikes of the data alone.
    pub(crate) data_alone: Totals,
    /// The same with sub-spectral regularisation at the usual threshold.
    pub(crate) totals: Totals,
}

/// Rows of each draw, `count` of `points`.
pub(crate) fn draws(count: usize, points: usize) -> Vec<(String, Vec<u32>)> {
    (1..=DRAWS).map(|seed| (format!("random {seed}"), Random::new(seed).choose(count, points))).collect()
}
