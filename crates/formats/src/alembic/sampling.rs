//! When samples are: evenly, in a cycle that repeats, or at times of their own.

use super::fields::Fields;
use super::ogawa::damaged;
use crate::error::Fault;

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
        while !fields.is_empty() {
            // How many samples use it, which these tell themselves.
            fields.number(2)?;
            let (cycle, count) = (fields.real()?, fields.number(2)?);
            let times = fields.take(count.saturating_mul(8))?;
            let stored: Vec<f64> = times.as_chunks().0.iter().map(|bytes| f64::from_le_bytes(*bytes)).collect();
            if stored.is_empty() || cycle.is_nan() || stored.iter().any(|time| !time.is_finite()) {
                return Err(damaged("a table of times has none, or one that is not finite"));
            }
            found.push(Self { cycle, stored });
        }
        Ok(found)
    }

    /// The times of all that has samples, of each so many; and how many these are.
    pub(super) fn union(all: &[(&Self, usize)]) -> (Self, usize) {
        let Some(&(most, count)) = all.iter().max_by_key(|(_, samples)| *samples) else {
            return (Self { cycle: ACYCLIC, stored: vec![0.0] }, 1);
        };
        if all.iter().all(|(other, _)| *other == most) {
            return (most.clone(), count);
        }
        let mut times: Vec<f64> =
            all.iter().flat_map(|(sampling, samples)| (0..*samples).map(|sample| sampling.time(sample))).collect();
        times.sort_by(f64::total_cmp);
        let length = times.last().unwrap_or(&0.0) - times[0];
        let near = NEAR * length / times.len() as f64;
        times.dedup_by(|later, earlier| *later - *earlier <= near);
        // As they are stored where others are at the same times.
        if times.len() == count {
            return (most.clone(), count);
        }
        let (step, start) = (length / (times.len() - 1).max(1) as f64, times[0]);
        let is_even = |(k, time): (usize, &f64)| (time - start - step * k as f64).abs() <= NEAR * step;
        let count = times.len();
        if count > 1 && times.iter().enumerate().all(is_even) {
            return (Self { cycle: step, stored: vec![start] }, count);
        }
        (Self { cycle: ACYCLIC, stored: times }, count)
    }

    fn is_acyclic(&self) -> bool {
        self.cycle >= NO_CYCLE
    }

    /// Seconds between samples, where that is the same for all, and the time of the first.
    pub(super) fn even(&self) -> Option<(f64, f64)> {
        let (step, start) = (self.cycle / self.stored.len() as f64, self.stored[0]);
        let is_even = |(k, time): (usize, &f64)| (time - start - step * k as f64).abs() <= NEAR * step.abs();
        (!self.is_acyclic() && self.stored.iter().enumerate().all(is_even)).then_some((step, start))
    }

    /// Whether so many samples have a time.
    pub(super) fn covers(&self, samples: usize) -> bool {
        !self.is_acyclic() || samples <= self.stored.len()
    }

    /// The time of a sample.
    pub(super) fn time(&self, sample: usize) -> f64 {
        let count = self.stored.len();
        if self.is_acyclic() {
            return self.stored[sample.min(count - 1)];
        }
        self.stored[sample % count] + self.cycle * (sample / count) as f64
    }

    /// The last of `samples` samples that is not after a time, and how far the time is on its way to the next, from 0 to 1.
    pub(super) fn find(&self, time: f64, samples: usize) -> (usize, f64) {
        let last = samples.saturating_sub(1);
        let (mut low, mut high) = (0, last);
        while low < high {
            let middle = low + (high - low).div_ceil(2);
            if self.time(middle) <= time { low = middle } else { high = middle - 1 }
        }
        let (before, after) = (self.time(low), self.time((low + 1).min(last)));
        let share = if after > before { (time - before) / (after - before) } else { 0.0 };
        if share > 1.0 - NEAR {
            return (low + usize::from(low < last), 0.0);
        }
        (low, if share > NEAR { share } else { 0.0 })
    }
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
    fn samples_are_found_by_their_times() {
        let all = [table(0.5, &[1.0]), table(1.0, &[0.0, 0.75]), table(ACYCLIC, &[0.0, 1.0, 4.0])].concat();
        let [even, cyclic, acyclic] = &Sampling::table(&all).unwrap()[..] else { panic!("three samplings") };
        assert_eq!((even.even(), cyclic.even(), acyclic.even()), (Some((0.5, 1.0)), None, None));
        assert_eq!((even.time(4), cyclic.time(3), acyclic.time(2)), (3.0, 1.75, 4.0));
        assert!(even.covers(1000) && acyclic.covers(3) && !acyclic.covers(4));
        for sampling in [even, cyclic, acyclic] {
            for sample in 0..3 {
                assert_eq!(sampling.find(sampling.time(sample), 3), (sample, 0.0));
            }
        }
        assert_eq!(acyclic.find(2.5, 3), (1, 0.5));
        assert_eq!((acyclic.find(-7.0, 3), acyclic.find(7.0, 3)), ((0, 0.0), (2, 0.0)));
        assert_eq!(even.find(1.0 + 1e-9, 1), (0, 0.0));
    }

    #[test]
    fn a_union_has_all_times_once() {
        let all = [table(0.2, &[1.0]), table(1.0, &[1.0]), table(ACYCLIC, &[1.0, 1.5, 4.0])].concat();
        let [fine, coarse, own] = &Sampling::table(&all).unwrap()[..] else { panic!("three samplings") };
        assert_eq!(Sampling::union(&[(fine, 11), (coarse, 3)]), (fine.clone(), 11));
        assert_eq!(Sampling::union(&[(coarse, 3), (coarse, 2)]), (coarse.clone(), 3));
        let times = |all: &[(&Sampling, usize)]| {
            let (sampling, count) = Sampling::union(all);
            (0..count).map(|sample| sampling.time(sample)).collect::<Vec<_>>()
        };
        assert_eq!(times(&[(coarse, 2), (own, 3)]), [1.0, 1.5, 2.0, 4.0]);
        // Those behind the points as well.
        assert_eq!(times(&[(fine, 3), (coarse, 3)]), [1.0, 1.2, 1.4, 2.0, 3.0]);
    }

    #[test]
    fn times_that_are_none_are_refused() {
        for bytes in [table(1.0, &[]), table(f64::NAN, &[0.0]), table(1.0, &[f64::INFINITY]), vec![1, 2, 3]] {
            assert!(Sampling::table(&bytes).is_err());
        }
    }
}
