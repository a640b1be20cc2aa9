//! Motion Designer: frames, points, a time in seconds for each frame, then `f32`; all big-endian.

use super::cache::Layout;
use super::widen::Scalar;
use crate::error::Fault;

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
    let time = |k: usize| head.as_chunks().0.get(2 + k).map(|bytes| f64::from(f32::from_be_bytes(*bytes)));
    let frame_rate = match (time(0), time(1)) {
        (Some(first), Some(second)) if frames > 1 => rate(second - first),
        _ => None,
    };
    let mut layout = Layout::new(points, frames, 8 + 4 * frames, Scalar::F32Big);
    layout.frame_rate = frame_rate;
    if let (Some(rate), Some(time)) = (frame_rate, time(0)) {
        let first = (1000.0 * rate * time).round() / 1000.0;
        layout.first = if first.abs() < 1e9 { first } else { 0.0 };
    }
    Ok(layout)
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
