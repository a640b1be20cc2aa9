//! Motion Designer: frames, points, a time in seconds for each frame, then `f32`; all big-endian.

use super::layout::Layout;
use super::times::Times;
use super::widen::Scalar;
use crate::error::Fault;

/// Offset of the times.
pub(super) const HEADER: u64 = 8;

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

/// The times of all frames, as they are stored.
pub(super) fn times(stored: &[u8]) -> Result<Times, Fault> {
    let times: Vec<f64> = stored.as_chunks().0.iter().map(|bytes| f32::from_be_bytes(*bytes).into()).collect();
    Times::of(&times, None)
}

/// A header for frames at these times.
pub(super) fn header(points: i32, frames: i32, times: impl Iterator<Item = f32>) -> Vec<u8> {
    let counts = [frames, points].into_iter().flat_map(i32::to_be_bytes);
    counts.chain(times.flat_map(f32::to_be_bytes)).collect()
}
