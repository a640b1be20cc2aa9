//! Volume and condition number of `Φ□` after every swap of maxvol (the paper's Fig. 4).

use crate::noise::Random;
use cager_core::spectral::Analysis;
use cager_core::spectral::maxvol::{MaxVol, TOLERANCE, maxvol_from, start_rows};
use faer::Mat;
use rayon::prelude::*;
use serde::Serialize;

/// Condition numbers are computed after at most this many swaps, evenly spaced.
const CONDITIONS: usize = 24;
/// Of more coordinates than this, the search with a random start takes evenly spaced points.
const MAX_ENTRIES: usize = 6_000_000;
/// Points drawn for a random start, as multiples of the unknowns: among few there may be no
/// independent ones, and all of them would be no draw.
const DRAWN: [usize; 7] = [2, 3, 4, 5, 6, 8, 16];

#[derive(Clone, Debug, Serialize)]
pub(crate) struct Swaps {
    /// From the rows that LU with partial pivoting picks, as every encoding does it.
    pub(crate) from_lu: Option<SwapTrace>,
    /// From rows that LU picks among points drawn at random; null where none are independent.
    pub(crate) from_random: Option<SwapTrace>,
}

#[derive(Clone, Debug, Serialize)]
pub(crate) struct SwapTrace {
    /// Points it chose from.
    pub(crate) points: usize,
    /// `ln |det Φ□|` at the start and after every swap.
    pub(crate) log_volume: Vec<f64>,
    /// Numbers of swaps after which the condition number was computed.
    pub(crate) after: Vec<usize>,
    /// Condition numbers of `Φ□` there.
    pub(crate) condition: Vec<f64>,
}

impl Swaps {
    pub(crate) fn of(analysis: &Analysis) -> Self {
        let phi = analysis.coordinates();
        let all: Vec<u32> = (0..phi.nrows() as u32).collect();
        let from_lu = || analysis.handles().map(|handles| SwapTrace::of(handles, analysis, &all));
        let (from_lu, from_random) = rayon::join(from_lu, || from_random(analysis));
        Self { from_lu, from_random }
    }
}

fn from_random(analysis: &Analysis) -> Option<SwapTrace> {
    let phi = analysis.coordinates();
    let (n, m) = phi.shape();
    if analysis.preparation().rank < m {
        return None;
    }
    let step = n.div_ceil((MAX_ENTRIES / m).max(4 * m));
    let rows: Vec<u32> = (0..n as u32).step_by(step).collect();
    if rows.len() < m {
        return None;
    }
    let rows_of = |rows: &[u32]| Mat::from_fn(rows.len(), m, |i, j| phi[(rows[i] as usize, j)]);
    let some = rows_of(&rows);
    let found = DRAWN.iter().map(|times| times * m).take_while(|&count| count < rows.len()).find_map(|count| {
        let drawn = Random::new(0).choose(count, rows.len());
        let of_rows: Vec<u32> = drawn.iter().map(|&i| rows[i as usize]).collect();
        let start = start_rows(rows_of(&of_rows).as_ref()).ok()?;
        maxvol_from(some.as_ref(), start.iter().map(|&i| drawn[i as usize]).collect(), TOLERANCE).ok()
    })?;
    Some(SwapTrace::of(&found, analysis, &rows))
}

impl SwapTrace {
    /// `rows` are the rows of all points among which the search was.
    fn of(found: &MaxVol, analysis: &Analysis, rows: &[u32]) -> Self {
        let mut log_volume = vec![found.start_log_volume];
        let mut volume = found.start_log_volume;
        let mut picked: Vec<u32> = found.start.iter().map(|&i| rows[i as usize]).collect();
        let step = found.trace.len().div_ceil(CONDITIONS).max(1);
        let (mut after, mut looked_at) = (vec![0], vec![picked.clone()]);
        for (k, swap) in found.trace.iter().enumerate() {
            volume += swap.growth.ln();
            log_volume.push(volume);
            picked[swap.position as usize] = rows[swap.row as usize];
            if (k + 1) % step == 0 || k + 1 == found.trace.len() {
                after.push(k + 1);
                looked_at.push(picked.clone());
            }
        }
        let condition = looked_at.par_iter().map(|rows| condition_of(analysis, rows)).collect();
        Self { points: rows.len(), log_volume, after, condition }
    }

    pub(crate) fn swaps(&self) -> usize {
        self.log_volume.len() - 1
    }
}

fn condition_of(analysis: &Analysis, rows: &[u32]) -> f64 {
    let sigma = analysis.spectrum_of(rows).unwrap_or_default();
    match (sigma.first(), sigma.last()) {
        (Some(first), Some(last)) => first / last,
        _ => f64::NAN,
    }
}
