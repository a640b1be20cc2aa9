//! Batches of frames on their way: read by one thread, solved by several, within a memory.

use crate::memory::Memory;
use cager_core::decode::FrameError;
use cager_core::inversion::{BATCH, Convergence, Rows, Solver};
use cager_formats::FrameReader;
use std::sync::mpsc::{Receiver, SyncSender};
use std::time::Instant;

/// Some frames, n × 3 each.
pub(super) type Batch = Vec<Vec<f64>>;

/// Batch size and batches solved concurrently; as many are queued, and one is being read.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct BatchPlan {
    pub(super) size: usize,
    pub(super) concurrent: usize,
}

impl BatchPlan {
    /// With coordinates in memory one batch per thread, otherwise one, as computing them uses all
    /// threads.
    pub(super) fn new(memory: Memory, points: usize, keeps: bool) -> Self {
        let most = if keeps { rayon::current_num_threads() } else { 1 };
        let frames = memory.frames(24 * points, BATCH * (2 * most + 1));
        let concurrent = (frames.saturating_sub(1) / 2).clamp(1, most);
        Self { size: (frames / (2 * concurrent + 1)).max(1), concurrent }
    }
}

/// Reads all frames; returns the seconds spent reading, without waiting for the solver.
pub(super) fn read_batches(
    frames: &mut dyn FrameReader,
    size: usize,
    full: &SyncSender<Batch>,
    recycled: &Receiver<Batch>,
) -> Result<f64, cager_formats::Error> {
    let mut seconds = 0.0;
    loop {
        let clock = Instant::now();
        let mut batch = recycled.try_recv().unwrap_or_default();
        let mut filled = 0;
        while filled < size {
            if filled == batch.len() {
                batch.push(Vec::new());
            }
            if !frames.read_next(&mut batch[filled])? {
                break;
            }
            filled += 1;
        }
        batch.truncate(filled);
        seconds += clock.elapsed().as_secs_f64();
        if batch.is_empty() || full.send(batch).is_err() {
            return Ok(seconds);
        }
    }
}

/// The cages of a batch.
pub(super) struct SolvedBatch {
    pub(super) cages: Vec<Vec<f32>>,
    pub(super) errors: Vec<FrameError>,
    /// Empty where nothing was iterated.
    pub(super) convergence: Vec<Convergence>,
    /// Of each frame, whether its cage would have left it.
    pub(super) held: Vec<bool>,
    pub(super) invert_seconds: f64,
    pub(super) measure_seconds: f64,
}

/// Solves a batch after the cage `previous`; `measures` whether errors are those of these cages.
pub(super) fn solve(solver: &Solver, batch: &Batch, previous: Option<&[f32]>, measures: bool) -> SolvedBatch {
    let frames: Vec<&[f64]> = batch.iter().map(Vec::as_slice).collect();
    let clock = Instant::now();
    let inverted = solver.invert(Rows::All, previous, &frames);
    let invert_seconds = clock.elapsed().as_secs_f64();
    let convergence = inverted.iter().filter_map(|inverted| inverted.convergence).collect();
    let held = inverted.iter().map(|inverted| inverted.held).collect();
    let cages: Vec<Vec<f32>> = inverted.into_iter().map(|inverted| inverted.cage).collect();
    let views: Vec<&[f32]> = cages.iter().map(Vec::as_slice).collect();
    let errors = if measures { solver.decoder().measure(&views, &frames) } else { Vec::new() };
    let measure_seconds = if measures { clock.elapsed().as_secs_f64() - invert_seconds } else { 0.0 };
    SolvedBatch { cages, errors, convergence, held, invert_seconds, measure_seconds }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_on_their_way_fit_into_memory_with_any_number_of_threads() {
        for threads in [1, 2, 64] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
            for (points, keeps) in [(100, true), (100, false), (1_000_000, true), (1_000_000, false)] {
                let BatchPlan { size, concurrent } =
                    pool.install(|| BatchPlan::new(Memory::at_most(1 << 30), points, keeps));
                let most = (24 * points * size * (2 * concurrent + 1)) as u64;
                assert!(
                    (1..=BATCH).contains(&size) && concurrent >= 1 && most <= 1 << 28,
                    "{threads} {points}: {most}"
                );
                assert!(points > 100 || size == BATCH && concurrent == if keeps { threads } else { 1 });
            }
        }
    }
}
