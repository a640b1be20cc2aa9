//! When samples are: evenly, in a cycle that repeats, or at times of their own; and the frame rate
//! and frame numbers that these tell.

use crate::error::Fault;
use crate::frames::{Times, nominal};
use crate::scene::{Fields, damaged};

/// The length of no cycle: Alembic's largest number over 32, and what rounds to it.
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

/// Samples between two frames that a frame rate is still that of the program by.
const MOST_BETWEEN: f64 = 64.0;
/// How near to a whole number a number is one: frame rates are rounded to two digits in places.
const WHOLE: f64 = 1e-4;

/// How near two frame rates are to be the same.
const EQUAL: f64 = 1e-9;
/// The least frame rate, a sample in eleven days.
const SLOWEST: f64 = 1e-6;

/// By the times of frames, `step` apart where even; `told` is the frame rate of the program.
pub(super) fn timing(times: &[f64], step: Option<f64>, told: Option<f64>) -> Result<Times, Fault> {
    let (Some(step), Some(&start)) = (step, times.first()) else { return Times::of(times, told) };
    let own = 1.0 / step;
    let sane = |number: f64| number.is_finite() && number.abs() < 1e9;
    if !(sane(own) && own >= SLOWEST && sane(start * own)) {
        if times.len() == 1 {
            return Ok(Times { frame_rate: told, ..Times::default() });
        }
        let what = format!("has samples {step} s apart from {start} s on; export it again with times in seconds");
        return Err(Fault::invalid(what));
    }
    let own = told.filter(|told| (told * step - 1.0).abs() < EQUAL).unwrap_or_else(|| nominal(rounded(own, 1e3, 1e-6)));
    // Several samples a frame, or one for several frames, are counted in frames all the same.
    let frames = told.map(|told| rounded(told * step, 1.0, WHOLE)).filter(|&frames| {
        let is_whole = |x: f64| x >= 1.0 && (x - x.round()).abs() < WHOLE * x;
        frames != 1.0 && (is_whole(frames) || is_whole(1.0 / frames) && 1.0 / frames <= MOST_BETWEEN)
    });
    let seconds = step;
    let (frame_rate, step) = told.zip(frames).unwrap_or((own, 1.0));
    let first = rounded(rounded(start / seconds * step, 1.0, WHOLE), 1e6, 1e-3);
    Ok(Times { frame_rate: Some(frame_rate), first, step, ..Times::default() })
}

/// A number with `digits` steps to one, where it is so close to one of these.
fn rounded(number: f64, digits: f64, near: f64) -> f64 {
    let scaled = number * digits;
    if (scaled - scaled.round()).abs() < near { scaled.round() / digits } else { number }
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

    #[test]
    fn samples_that_are_years_apart_give_no_rate() {
        assert_eq!(timing(&[0.0], Some(1e10), None).unwrap().frame_rate, None);
        assert!(timing(&[0.0, 1e10], Some(1e10), None).is_err());
    }
}
