//! Frames of a layer: at whole time codes as far as its samples are, or at its samples.

use super::layer::Stage;
use crate::error::Fault;
use crate::frames::{Times, nominal};
use crate::scene::{Timeline, check_held, union};

/// Time codes per second where a layer does not say them.
const USUAL: f64 = 24.0;
/// The largest time code that is taken.
const FARTHEST: f64 = 1e9;
/// Time codes within which two are one.
const NEAR: f64 = 1e-6;

/// By the times of samples of all that moves.
pub(super) fn timeline(stage: &Stage, samples: Vec<f64>) -> Result<Timeline, Fault> {
    let samples = union(samples, NEAR);
    let sane = |rate: &f64| (1e-3..1e6).contains(rate);
    let fps = stage.frames_per_second.filter(sane).map(nominal);
    let told = stage.time_codes_per_second.filter(sane).map(nominal).or(fps);
    let rate = told.unwrap_or(USUAL);
    if samples.iter().any(|code| code.abs() > FARTHEST) {
        return Err(Fault::invalid(format!(
            "has time codes beyond {FARTHEST:e}; export it again with numbers of frames as time codes"
        )));
    }
    let (Some(&start), Some(&end)) = (samples.first(), samples.last()) else {
        let times = Times { frame_rate: told, ..Times::default() };
        return Ok(Timeline { times, at: vec![0.0] });
    };
    // Some layers count in smaller units than frames.
    let step = fps.map_or(1.0, |fps| rate / fps).max(1.0);
    let whole = |code: f64| (code - start) / step;
    let is_even = |distance: f64| {
        samples.iter().all(|code| {
            let steps = (code - start) / distance;
            (steps - steps.round()).abs() * distance <= NEAR.max(1e-5 * distance)
        })
    };
    if samples.len() > 1 && !is_even(step) {
        let distance = (end - start) / (samples.len() - 1) as f64;
        if distance < step && is_even(distance) {
            return Ok(even(rate / step, (start, distance, samples.len()), step, samples.len()));
        }
        let seconds: Vec<f64> = samples.iter().map(|code| code / rate).collect();
        let times = Times::of(&seconds, Some(rate / step))?;
        return Ok(Timeline { times, at: samples });
    }
    // What does not change before or after is not always stored.
    let told = |bound: Option<f64>| bound.filter(|bound| bound.is_finite() && samples.len() > 1);
    let before = told(stage.start).map_or(0.0, |bound| whole(start - bound + start).floor().max(0.0));
    let after = told(stage.end).map_or(whole(end), |bound| whole(bound).floor().max(whole(end)));
    let count = (before + after.round() + 1.0).min(u32::MAX.into()) as usize;
    check_held(count, samples.len() >= count / 2)?;
    Ok(even(rate / step, (start - before * step, step, count), step, samples.len()))
}

fn even(rate: f64, (first, distance, frames): (f64, f64, usize), step: f64, stored: usize) -> Timeline {
    let note = (stored < frames && stored > 1).then(|| {
        format!(
            "it stores {stored} of its {frames} frames; those between are interpolated, and before and after \
             nothing moves"
        )
    });
    let times = Times { frame_rate: Some(rate), first: first / step, step: distance / step, numbers: None, note };
    Timeline { times, at: (0..frames).map(|frame| first + distance * frame as f64).collect() }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn grid(stage: &Stage, samples: &[f64]) -> (Option<f64>, Vec<f64>, Vec<f64>) {
        let Timeline { times, at } = timeline(stage, samples.to_vec()).unwrap();
        let numbers = (0..at.len()).map(|frame| times.number(frame)).collect();
        (times.frame_rate, at, numbers)
    }

    #[test]
    fn frames_are_whole_time_codes_over_the_range_of_the_stage() {
        let rate = |rate| Stage { time_codes_per_second: Some(rate), ..Stage::default() };
        let frames = vec![1.0, 2.0, 3.0, 4.0];
        assert_eq!(grid(&rate(25.0), &[1.0, 3.0, 4.0]), (Some(25.0), frames.clone(), frames.clone()));
        let wide = Stage { start: Some(0.0), end: Some(5.5), ..rate(30.0) };
        let wider = vec![0.0, 1.0, 2.0, 3.0, 4.0, 5.0];
        assert_eq!(grid(&wide, &[2.0, 1.0, 2.0, 4.0]), (Some(30.0), wider.clone(), wider));
        assert_eq!(grid(&wide, &[]), (Some(30.0), vec![0.0], vec![0.0]));
        assert_eq!(grid(&wide, &[3.0]), (Some(30.0), vec![3.0], vec![3.0]));
        let narrow = Stage { start: Some(2.0), end: Some(2.0), ..Stage::default() };
        assert_eq!(grid(&narrow, &[1.5, 3.5]), (Some(24.0), vec![1.5, 2.5, 3.5], vec![1.5, 2.5, 3.5]));
    }

    #[test]
    fn samples_between_frames_are_frames() {
        let stage = Stage::default();
        assert_eq!(grid(&stage, &[0.0, 0.5, 1.0]).2, [0.0, 0.5, 1.0]);
        assert_eq!(grid(&stage, &[0.0, 0.25, 3.0]).2, [0.0, 0.25, 3.0]);
        let fine = Stage { time_codes_per_second: Some(600.0), frames_per_second: Some(30.0), ..Stage::default() };
        assert_eq!(
            grid(&fine, &[20.0, 40.0, 80.0]),
            (Some(30.0), vec![20.0, 40.0, 60.0, 80.0], vec![1.0, 2.0, 3.0, 4.0])
        );
        assert_eq!(grid(&fine, &[20.0, 50.0, 85.0]), (Some(30.0), vec![20.0, 50.0, 85.0], vec![1.0, 2.5, 4.25]));
    }

    #[test]
    fn ranges_that_the_layer_does_not_hold_are_refused() {
        let endless = Stage { end: Some(1e300), ..Stage::default() };
        assert!(timeline(&endless, vec![0.0, 1.0]).is_err() && timeline(&endless, vec![0.0]).is_ok());
        assert!(timeline(&Stage::default(), vec![0.0, 1e12]).is_err());
    }
}
