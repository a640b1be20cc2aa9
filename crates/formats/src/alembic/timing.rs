//! Frame rate and frame numbers of samples, by their times.

use crate::error::Fault;
use crate::frames::{Times, nominal};

/// Samples between two frames that a frame rate is still that of the program by.
const MOST_BETWEEN: f64 = 64.0;
/// How near to a whole number a number is one: frame rates are rounded to two digits in places.
const NEAR: f64 = 1e-4;

/// How near two frame rates are to be the same.
const EQUAL: f64 = 1e-9;
/// The least frame rate, a sample in eleven days.
const SLOWEST: f64 = 1e-6;

/// By the times of all frames, `step` apart where they are even; `told` is the frame rate of the program that wrote the archive.
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
    // A program that writes several samples a frame, or one for several frames, counts in frames all the same.
    let frames = told.map(|told| rounded(told * step, 1.0, NEAR)).filter(|&frames| {
        let is_whole = |x: f64| x >= 1.0 && (x - x.round()).abs() < NEAR * x;
        frames != 1.0 && (is_whole(frames) || is_whole(1.0 / frames) && 1.0 / frames <= MOST_BETWEEN)
    });
    let seconds = step;
    let (frame_rate, step) = told.zip(frames).unwrap_or((own, 1.0));
    let first = rounded(rounded(start / seconds * step, 1.0, NEAR), 1e6, 1e-3);
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

    #[test]
    fn samples_that_are_years_apart_give_no_rate() {
        assert_eq!(timing(&[0.0], Some(1e10), None).unwrap().frame_rate, None);
        assert!(timing(&[0.0, 1e10], Some(1e10), None).is_err());
    }
}
