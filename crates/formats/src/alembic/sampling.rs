//! When samples are: evenly, in a cycle that repeats, or at times of their own.

use crate::error::Fault;
use crate::scene::{Fields, damaged};

/// The length of a cycle that says that there is none: Alembic's largest number over 32, and what rounds to it.
const NO_CYCLE: f64 = f64::MAX / 64.0;
/// What [`NO_CYCLE`] is written as.
pub(super) const ACYCLIC: f64 = f64::MAX / 32.0;
/// Shares of a sample by which a time may miss one.
const NEAR: f64 = 1e-6;

/// The times of the samples of a property, in seconds.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Sampling {
    /// Seconds after which the stored times repeat.
    cycle: f64,
    /// At least one.
    stored: Vec<f64>,
}

impl Sampling {
    /// All samplings of an archive.
    pub(super) fn table(bytes: &[u8]) -> Result<Vec<Self>, Fault> {
        let mut fields = Fields(bytes);
        let mut found = Vec::new();
        while !fields.0.is_empty() {
            // How many samples use it, which these tell themselves.
            fields.short(2)?;
            let (cycle, count) = (f64::from_le_bytes(fields.array()?), fields.short(2)?);
            let times = fields.take(count.saturating_mul(8))?;
            let stored: Vec<f64> = times.as_chunks().0.iter().map(|bytes| f64::from_le_bytes(*bytes)).collect();
            if stored.is_empty() || cycle.is_nan() || stored.iter().any(|time| !time.is_finite()) {
                return Err(damaged("a table of times has none, or one that is not finite"));
            }
            found.push(Self { cycle, stored });
        }
        Ok(found)
    }

    fn is_acyclic(&self) -> bool {
        self.cycle >= NO_CYCLE
    }

    /// Seconds between samples, where that is the same for all.
    pub(super) fn step(&self) -> Option<f64> {
        let step = self.cycle / self.stored.len() as f64;
        (!self.is_acyclic() && is_even(&self.stored, step)).then_some(step)
    }

    /// Seconds between times, where that is the same for all of several.
    pub(super) fn step_of(times: &[f64]) -> Option<f64> {
        let step = (times.last()? - times[0]) / (times.len() - 1) as f64;
        is_even(times, step).then_some(step)
    }

    /// The times of so many samples.
    pub(super) fn times(&self, samples: usize) -> Result<Vec<f64>, Fault> {
        let count = self.stored.len();
        if self.is_acyclic() && samples > count {
            return Err(damaged(&format!("it promises {samples} frames, of which not all can be there")));
        }
        let cycle = if self.is_acyclic() { 0.0 } else { self.cycle };
        let times: Vec<f64> = (0..samples).map(|k| self.stored[k % count] + cycle * (k / count) as f64).collect();
        match times.windows(2).find(|pair| pair[0] >= pair[1]) {
            None => Ok(times),
            Some(pair) => {
                let what = format!(
                    "has a sample at {} s after one at {} s; export it again with times in seconds",
                    pair[1], pair[0]
                );
                Err(Fault::invalid(what))
            }
        }
    }
}

fn is_even(times: &[f64], step: f64) -> bool {
    times.iter().enumerate().all(|(k, time)| (time - times[0] - step * k as f64).abs() <= NEAR * step.abs())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn table(cycle: f64, times: &[f64]) -> Vec<u8> {
        let mut bytes = 9_u32.to_le_bytes().to_vec();
        bytes.extend(cycle.to_le_bytes());
        bytes.extend((times.len() as u32).to_le_bytes());
        bytes.extend(times.iter().flat_map(|time| time.to_le_bytes()));
        bytes
    }

    #[test]
    fn samples_have_times() {
        let all = [table(0.5, &[1.0]), table(1.0, &[0.0, 0.75]), table(ACYCLIC, &[0.0, 1.0, 4.0])].concat();
        let [even, cyclic, acyclic] = &Sampling::table(&all).unwrap()[..] else { panic!("three samplings") };
        assert_eq!((even.step(), cyclic.step(), acyclic.step()), (Some(0.5), None, None));
        let last = |sampling: &Sampling, samples| sampling.times(samples).unwrap().pop().unwrap();
        assert_eq!((last(even, 5), last(cyclic, 4), last(acyclic, 3)), (3.0, 1.75, 4.0));
        assert!(even.times(1000).is_ok() && acyclic.times(4).is_err());
    }

    #[test]
    fn times_that_are_none_are_refused() {
        for bytes in [table(1.0, &[]), table(f64::NAN, &[0.0]), table(1.0, &[f64::INFINITY]), vec![1, 2, 3]] {
            assert!(Sampling::table(&bytes).is_err());
        }
    }
}
