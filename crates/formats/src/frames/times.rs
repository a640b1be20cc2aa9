//! Frame rate and frame numbers, as the times of frames tell them.

use crate::error::Fault;

/// Share of a step by which evenly spaced times may be off.
const EVEN: f64 = 0.05;
/// Seconds by which they may be off: some programs round times to thousandths.
const ROUNDED: f64 = 1e-3;
/// Rates that television has 1,000/1,001 of.
const TELEVISION: [f64; 6] = [24.0, 30.0, 48.0, 60.0, 120.0, 240.0];

/// When frames are: by default numbered from 0, at a rate that is not known.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Times {
    /// Frames per second.
    pub(crate) frame_rate: Option<f64>,
    /// Number of the first frame, and the distance of two.
    pub(crate) first: f64,
    pub(crate) step: f64,
    /// Numbers of all frames, where these do not have the same distance.
    pub(crate) numbers: Option<Vec<f64>>,
    /// What the user should know of them.
    pub(crate) note: Option<String>,
}

impl Default for Times {
    fn default() -> Self {
        Self { frame_rate: None, first: 0.0, step: 1.0, numbers: None, note: None }
    }
}

impl Times {
    /// The number of a frame.
    pub(crate) fn number(&self, frame: usize) -> f64 {
        let told = self.numbers.as_ref().and_then(|numbers| numbers.get(frame));
        told.copied().unwrap_or(self.first + self.step * frame as f64)
    }

    /// Numbers frames by another one for what was 0.
    pub(crate) fn begin_at(&mut self, number: f64) {
        self.first += number;
        self.numbers.iter_mut().flatten().for_each(|told| *told += number);
    }

    /// By the times of all frames in seconds; `told` is a frame rate that the file says.
    ///
    /// Uneven times are kept as numbers: a number over the frame rate is its frame's time.
    pub(crate) fn of(times: &[f64], told: Option<f64>) -> Result<Self, Fault> {
        let mut found = Self::default();
        let (Some(&first), Some(&last)) = (times.first(), times.last()) else { return Ok(found) };
        // Some programs leave them all at zero.
        if times.iter().all(|&time| time == first) {
            return Ok(found);
        }
        if let Some(k) = (1..times.len()).find(|&k| !(times[k] > times[k - 1] && times[k].is_finite())) {
            return Err(Fault::invalid(format!(
                "has frame {k} at {} s after frame {} at {} s; export it again with times that ascend",
                times[k],
                k - 1,
                times[k - 1]
            )));
        }
        let told = told.map(nominal);
        let step = (last - first) / (times.len() - 1) as f64;
        let slack = (EVEN * step).max(ROUNDED).min(step / 4.0);
        let off = |(k, time): (usize, &f64)| (time - first - step * k as f64).abs() > slack;
        if !times.iter().enumerate().any(off) {
            found.frame_rate = told.filter(|told| (told * step - 1.0).abs() < 1e-3).or_else(|| rate(step));
            if let Some(rate) = found.frame_rate {
                let number = near_whole(rate * first);
                found.first = if number.abs() < 1e9 { number } else { 0.0 };
            }
            return Ok(found);
        }
        let mut steps: Vec<f64> = times.windows(2).map(|pair| pair[1] - pair[0]).collect();
        steps.sort_by(f64::total_cmp);
        let (shortest, usual, longest) = (steps[0], steps[steps.len() / 2], steps[steps.len() - 1]);
        let Some(rate) =
            told.or_else(|| rate(usual)).filter(|rate| (rate * last).abs() < 1e9 && (rate * first).abs() < 1e9)
        else {
            return Err(Fault::invalid(format!(
                "has times from {first} s to {last} s; export it again with times in seconds"
            )));
        };
        found.frame_rate = Some(rate);
        let rounded: Vec<f64> = times.iter().map(|time| near_whole(rate * time)).collect();
        let ascend = rounded.windows(2).all(|pair| pair[0] < pair[1]);
        found.numbers = Some(if ascend { rounded } else { times.iter().map(|time| rate * time).collect() });
        found.note = Some(format!(
            "its times are not evenly spaced, {shortest:.4} s to {longest:.4} s apart; they are kept as the numbers of \
             its frames, at {rate} frames per second"
        ));
        Ok(found)
    }
}

/// A number to its thousandths, and a whole one where it is that but for rounded times.
pub(super) fn near_whole(number: f64) -> f64 {
    let whole = number.round();
    if (number - whole).abs() < 0.02 { whole } else { (1000.0 * number).round() / 1000.0 }
}

/// Times of single precision tell thousandths of a frame per second at the most.
fn rate(step: f64) -> Option<f64> {
    let rate = (1000.0 / step).round() / 1000.0;
    (rate.is_finite() && rate > 0.0).then(|| nominal(rate))
}

/// A rate of television where it is one but for its digits: 24,000/1,001 for 23.976.
pub(crate) fn nominal(rate: f64) -> f64 {
    let whole = (1.001 * rate).round();
    let exact = whole * 1000.0 / 1001.0;
    if TELEVISION.contains(&whole) && (rate - exact).abs() <= 2e-6 * exact { exact } else { rate }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rates_of_television_are_fractions_and_others_stay() {
        for (told, rate) in [
            (23.976, 24_000.0 / 1001.0),
            (f64::from(23.976_f32), 24_000.0 / 1001.0),
            (29.97, 30_000.0 / 1001.0),
            (59.94, 60_000.0 / 1001.0),
            (119.88, 120_000.0 / 1001.0),
        ] {
            assert_eq!(nominal(told), rate);
            let at = |k: i32| f64::from((f64::from(k) / rate) as f32);
            let times: Vec<f64> = (0..40).map(at).collect();
            assert_eq!(Times::of(&times, None).unwrap().frame_rate, Some(rate));
        }
        for rate in [24.0, 23.98, 25.0, 12.5, 29.9, 1e-3, 1e6] {
            assert_eq!(nominal(rate), rate);
        }
    }
}
