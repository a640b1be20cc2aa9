//! The spectrum threshold from the capture itself: as large as a bound on the extra error lets it be.

use super::reading::Bent;
use super::{PrepareError, Pull, Reading, SolverOptions};
use crate::dense;
use crate::regularize::{Reference, Term};
use faer::Mat;

/// Errors below this fraction of the diagonal are rounding: more of it is no loss.
const ROUNDING: f64 = 1e-6;

/// A frame to measure thresholds on.
#[derive(Clone, Debug)]
pub struct Sample {
    /// The frame, n × 3 interleaved.
    pub frame: Vec<f64>,
    /// The frame before, for terms that follow it.
    pub previous: Option<Vec<f64>>,
}

/// A threshold that was chosen, and why.
#[derive(Clone, Debug, PartialEq)]
pub struct Threshold {
    /// The largest threshold found whose error stays within the bound.
    pub spectrum: usize,
    /// Frames measured.
    pub frames: usize,
    /// Mean L2 error of these frames over the rest diagonal for every threshold that was tried, ascending by threshold.
    pub tried: Vec<(usize, f64)>,
}

impl Threshold {
    /// Mean L2 error at the chosen threshold over that at threshold 0, less one.
    pub fn extra(&self) -> f64 {
        let at = |s| self.tried.iter().find(|&&(tried, _)| tried == s).map_or(0.0, |&(_, l2)| l2);
        if at(0) > 0.0 { at(self.spectrum) / at(0) - 1.0 } else { 0.0 }
    }
}

/// What one sample contributes to every threshold.
struct Read<'a> {
    frame: &'a [f64],
    /// `Uᵀ H`, r × 3.
    coefficients: Mat<f64>,
    /// Mean of the rows read.
    mean: [f64; 3],
    previous: Option<Vec<f32>>,
}

impl Reading<'_> {
    /// The largest threshold at which the mean L2 error of these frames exceeds that at threshold 0 by no more than the fraction
    /// `bound`. One decomposition serves all thresholds. A frame's predecessor is taken at threshold 0.
    ///
    /// # Errors
    /// As [`Solver::prepare`](super::Solver::prepare).
    ///
    /// # Panics
    /// Where a frame's length does not fit, or there is none.
    pub fn choose_threshold(
        &self,
        options: SolverOptions,
        term: &dyn Term,
        samples: &[Sample],
        bound: f64,
    ) -> Result<Threshold, PrepareError> {
        assert!(!samples.is_empty(), "a frame to measure");
        let m = self.analysis.phi.ncols();
        let bent = self.bent(term)?;
        let ones = Mat::full(self.analysis.phi.nrows(), 1, 1.0);
        let of_ones = self.decomposed.coefficients(self.analysis.phi.as_ref(), ones.as_ref());
        let at = |s| self.at_threshold(&bent, options, s, &of_ones);
        let mut read: Vec<Read<'_>> = samples.iter().map(|sample| self.read(&sample.frame)).collect();
        if bent.reference == Reference::PreviousCage {
            let zero = at(0)?;
            for (read, sample) in read.iter_mut().zip(samples) {
                read.previous = sample.previous.as_ref().map(|previous| zero.cage(&self.read(previous)));
            }
        }
        let error = |s: usize| -> Result<f64, PrepareError> {
            let at_s = at(s)?;
            let l2 = |read: &Read<'_>| {
                self.analysis.decoder.measure(&[&at_s.cage(read)], &[read.frame])[0].l2 / self.analysis.diagonal
            };
            Ok(read.iter().map(l2).sum::<f64>() / read.len() as f64)
        };
        let mut tried = vec![(0, error(0)?)];
        let most = (1.0 + bound) * tried[0].1.max(ROUNDING);
        let (mut fits, mut exceeds) = (0, m + 1);
        // Steps of growing width, then halves.
        let mut next = 1;
        while fits < m && exceeds > m {
            let s = next.min(m);
            tried.push((s, error(s)?));
            (fits, exceeds) = if tried.last().is_some_and(|&(_, l2)| l2 <= most) { (s, exceeds) } else { (fits, s) };
            next += (next / 2).max(1);
        }
        while exceeds - fits > 1 && exceeds <= m {
            let s = fits.midpoint(exceeds);
            tried.push((s, error(s)?));
            (fits, exceeds) = if tried.last().is_some_and(|&(_, l2)| l2 <= most) { (s, exceeds) } else { (fits, s) };
        }
        tried.sort_by_key(|&(s, _)| s);
        Ok(Threshold { spectrum: fits, frames: samples.len(), tried })
    }

    fn at_threshold(
        &self,
        bent: &Bent,
        options: SolverOptions,
        s: usize,
        of_ones: &Mat<f64>,
    ) -> Result<AtThreshold, PrepareError> {
        let map = self.map(bent, options.regularizer, s, options.lambda)?;
        let to_cage = dense::product(self.decomposed.v.as_ref(), map.data.as_ref());
        let sums = dense::product(to_cage.as_ref(), of_ones.as_ref());
        let positions = self.analysis.decoder.positions();
        let missing = (0..sums.nrows()).map(|j| if j < positions { 1.0 } else { 0.0 } - sums[(j, 0)]).collect();
        Ok(AtThreshold { to_cage, missing, pull: self.pull(&map, bent.reference), positions })
    }

    fn read<'a>(&self, frame: &'a [f64]) -> Read<'a> {
        let n = self.analysis.phi.nrows();
        assert_eq!(frame.len(), 3 * n, "every frame has every point");
        let matrix = Mat::from_fn(n, 3, |i, k| frame[3 * i + k]);
        let coefficients = self.decomposed.coefficients(self.analysis.phi.as_ref(), matrix.as_ref());
        let found = &self.decomposed;
        let rows = if found.reads_all { n } else { found.handles.len() };
        let mut mean = [0.0; 3];
        for row in 0..rows {
            let i = if found.reads_all { row } else { found.handles[row] as usize };
            for k in 0..3 {
                mean[k] += frame[3 * i + k] / rows as f64;
            }
        }
        Read { frame, coefficients, mean, previous: None }
    }
}

/// The inversion at one threshold.
struct AtThreshold {
    /// m × r.
    to_cage: Mat<f64>,
    /// What is missing for cages to follow translations: see [`keep_translations`](super::translations::keep_translations).
    missing: Vec<f64>,
    pull: Pull,
    positions: usize,
}

impl AtThreshold {
    fn cage(&self, read: &Read<'_>) -> Vec<f32> {
        let q = dense::product(self.to_cage.as_ref(), read.coefficients.as_ref());
        let row = |j: usize| [0, 1, 2].map(|k| q[(j, k)] + self.missing[j] * read.mean[k]);
        let mut cage: Vec<[f64; 3]> = (0..q.nrows()).map(row).collect();
        self.pull.add(&mut cage, read.previous.as_deref(), self.positions);
        cage.as_flattened().iter().map(|&x| x as f32).collect()
    }
}
