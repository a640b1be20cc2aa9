//! Automatic choice of the spectrum threshold by the error on sample frames.

use super::HandleSystem;
use crate::inversion::{BATCH, PrepareError, Rows, Solver, SolverOptions};
use cager_geometry::linalg::SparseMatrix;
use rayon::prelude::*;

/// Errors below this fraction of the diagonal count as rounding.
const ROUNDING: f64 = 1e-6;

/// A chosen threshold, and the errors it was chosen by.
#[derive(Clone, Debug, PartialEq)]
pub struct Threshold {
    /// The largest threshold found whose error stays within the bound.
    pub spectrum: usize,
    /// Frames measured.
    pub frames: usize,
    /// Mean L2 error of these frames over the rest diagonal for every threshold tried, ascending.
    pub tried: Vec<(usize, f64)>,
}

impl Threshold {
    /// Relative increase of the mean L2 error over that at threshold 0.
    pub fn extra(&self) -> f64 {
        let at = |s| self.tried.iter().find(|&&(tried, _)| tried == s).map_or(0.0, |&(_, l2)| l2);
        if at(0) > 0.0 { at(self.spectrum) / at(0) - 1.0 } else { 0.0 }
    }
}

impl HandleSystem<'_> {
    /// The largest threshold found at which the mean L2 error of these frames, each n × 3
    /// interleaved, exceeds that at threshold 0 by no more than the fraction `bound`. Where cages
    /// follow their predecessors the frames are the first of the capture, in order.
    ///
    /// # Panics
    /// Where a frame's length does not fit, or there is none.
    pub fn choose_threshold(
        &self,
        options: SolverOptions,
        matrix: Option<&SparseMatrix>,
        frames: &[Vec<f64>],
        bound: f64,
    ) -> Result<Threshold, PrepareError> {
        assert!(!frames.is_empty(), "a frame to measure");
        let m = self.analysis.found.phi.ncols();
        let error = |spectrum: usize| -> Result<f64, PrepareError> {
            Ok(mean_error(&self.solver(SolverOptions { spectrum, ..options }, matrix)?, frames))
        };
        let mut tried = vec![(0, error(0)?)];
        let most = (1.0 + bound) * tried[0].1.max(ROUNDING);
        let (mut fits, mut exceeds) = (0, m + 1);
        // Exponential search, then bisection.
        let mut next = 1;
        while fits < m && exceeds - fits > 1 {
            let s = if exceeds > m { next.min(m) } else { fits.midpoint(exceeds) };
            let l2 = error(s)?;
            tried.push((s, l2));
            (fits, exceeds) = if l2 <= most { (s, exceeds) } else { (fits, s) };
            next += (next / 2).max(1);
        }
        tried.sort_by_key(|&(s, _)| s);
        Ok(Threshold { spectrum: fits, frames: frames.len(), tried })
    }
}

/// Mean L2 error of frames over the rest diagonal.
fn mean_error(solver: &Solver, frames: &[Vec<f64>]) -> f64 {
    let measured = |frames: &[Vec<f64>]| {
        let frames: Vec<&[f64]> = frames.iter().map(Vec::as_slice).collect();
        let cages: Vec<Vec<f32>> =
            solver.invert(Rows::All, None, &frames).into_iter().map(|inverted| inverted.cage).collect();
        let views: Vec<&[f32]> = cages.iter().map(Vec::as_slice).collect();
        solver.decoder().measure(&views, &frames).iter().map(|error| error.l2).sum::<f64>()
    };
    let sum: f64 = if solver.follows_previous() {
        measured(frames)
    } else {
        frames.par_chunks(BATCH).map(measured).collect::<Vec<f64>>().iter().sum()
    };
    sum / frames.len() as f64 / solver.diagonal()
}
