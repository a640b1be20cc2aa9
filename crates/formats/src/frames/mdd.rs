//! Motion Designer: frames, points, a time in seconds for each frame, then `f32`; all big-endian.

use super::layout::Layout;
use super::widen::Scalar;
use crate::error::Fault;

/// Offset of the times.
pub(super) const HEADER: u64 = 8;

/// Share of a step by which evenly spaced times may be off.
const EVEN: f64 = 0.05;
/// Seconds by which they may be off: some programs round times to thousandths.
const ROUNDED: f64 = 1e-3;

pub(super) fn layout(head: &[u8]) -> Result<Layout, Fault> {
    let field = |k: usize| head.as_chunks().0.get(k).map(|bytes| i32::from_be_bytes(*bytes));
    let (Some(frames), Some(points)) = (field(0), field(1)) else {
        return Err(Fault::damaged("ends within its header; copy or export the file again"));
    };
    let (Ok(points), Ok(frames)) = (u64::try_from(points), u64::try_from(frames)) else {
        return Err(Fault::damaged(format!(
            "promises {frames} frames of {points} points, so this is not a .mdd file; export it again"
        )));
    };
    Ok(Layout::new(points, frames, HEADER + 4 * frames, Scalar::F32Big))
}

/// Frame rate and frame numbers by the times of all frames, as they are stored.
///
/// Times that are not evenly spaced are kept as numbers that are not: a number over the frame rate is its frame's time.
pub(super) fn set_times(layout: &mut Layout, stored: &[u8]) -> Result<(), Fault> {
    let times: Vec<f64> = stored.as_chunks().0.iter().map(|bytes| f32::from_be_bytes(*bytes).into()).collect();
    let (Some(&first), Some(&last)) = (times.first(), times.last()) else { return Ok(()) };
    // Some programs leave them all at zero.
    if times.iter().all(|&time| time == first) {
        return Ok(());
    }
    if let Some(k) = (1..times.len()).find(|&k| !(times[k] > times[k - 1] && times[k].is_finite())) {
        return Err(Fault::invalid(format!(
            "has frame {k} at {} s after frame {} at {} s; export it again with times that ascend",
            times[k],
            k - 1,
            times[k - 1]
        )));
    }
    let step = (last - first) / (times.len() - 1) as f64;
    let slack = (EVEN * step).max(ROUNDED).min(step / 4.0);
    let off = |(k, time): (usize, &f64)| (time - first - step * k as f64).abs() > slack;
    if !times.iter().enumerate().any(off) {
        layout.frame_rate = rate(step);
        if let Some(rate) = layout.frame_rate {
            let number = (1000.0 * rate * first).round() / 1000.0;
            layout.first = if number.abs() < 1e9 { number } else { 0.0 };
        }
        return Ok(());
    }
    let mut steps: Vec<f64> = times.windows(2).map(|pair| pair[1] - pair[0]).collect();
    steps.sort_by(f64::total_cmp);
    let (shortest, usual, longest) = (steps[0], steps[steps.len() / 2], steps[steps.len() - 1]);
    let Some(rate) = rate(usual).filter(|rate| (rate * last).abs() < 1e9 && (rate * first).abs() < 1e9) else {
        return Err(Fault::invalid(format!(
            "has times from {first} s to {last} s; export it again with times in seconds"
        )));
    };
    layout.frame_rate = Some(rate);
    let rounded: Vec<f64> = times.iter().map(|time| near_whole(rate * time)).collect();
    let ascend = rounded.windows(2).all(|pair| pair[0] < pair[1]);
    layout.numbers = Some(if ascend { rounded } else { times.iter().map(|time| rate * time).collect() });
    layout.note = Some(format!(
        "its times are not evenly spaced, {shortest:.4} s to {longest:.4} s apart; they are kept as the numbers of its frames, at {rate} frames per second"
    ));
    Ok(())
}

/// A number to its thousandths, and a whole one where it is that but for rounded times.
fn near_whole(number: f64) -> f64 {
    let whole = number.round();
    if (number - whole).abs() < 0.02 { whole } else { (1000.0 * number).round() / 1000.0 }
}

/// Times are single precision: thousandths of a frame per second are all they tell.
fn rate(step: f64) -> Option<f64> {
    let rate = (1000.0 / step).round() / 1000.0;
    (rate.is_finite() && rate > 0.0).then_some(rate)
}

/// The first eight bytes; the times are for the caller to write.
pub(super) fn header(points: i32, frames: i32) -> [u8; 8] {
    let mut header = [0; 8];
    header[..4].copy_from_slice(&frames.to_be_bytes());
    header[4..].copy_from_slice(&points.to_be_bytes());
    header
}
