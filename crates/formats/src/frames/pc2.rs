//! Point cache 2: `POINTCACHE2\0`, then version, points, first frame, frames per sample and
//! samples, then `f32`; all little-endian.

use super::layout::Layout;
use super::widen::Scalar;
use crate::error::Fault;

const MAGIC: &[u8; 12] = b"POINTCACHE2\0";
const HEADER: usize = 32;
/// Frame numbers beyond are no numbers of frames.
const MAX_FRAME_NUMBER: f64 = 1e9;

pub(super) fn layout(head: &[u8]) -> Result<Layout, Fault> {
    let Some(fields) = head.strip_prefix(MAGIC) else {
        return Err(Fault::damaged("does not begin with POINTCACHE2, so this is not a .pc2 file; export it again"));
    };
    let field = |k: usize| fields.as_chunks().0.get(k).map(|bytes| i32::from_le_bytes(*bytes));
    let (Some(version), Some(points), Some(frames)) = (field(0), field(1), field(4)) else {
        return Err(Fault::damaged("ends within its header; copy or export the file again"));
    };
    if version != 1 {
        return Err(Fault::unsupported(format!("is of version {version}; export it as version 1")));
    }
    let (Ok(points), Ok(frames)) = (u64::try_from(points), u64::try_from(frames)) else {
        return Err(Fault::damaged(format!("promises {frames} frames of {points} points; export it again")));
    };
    let real = |k: usize| fields.as_chunks().0.get(k).map(|bytes| f64::from(f32::from_le_bytes(*bytes)));
    // Some programs leave both at zero.
    let (first, step) = match (real(2), real(3)) {
        (Some(first), Some(step)) if first.abs() < MAX_FRAME_NUMBER && step > 0.0 && step < MAX_FRAME_NUMBER => {
            (first, step)
        }
        _ => (0.0, 1.0),
    };
    let mut layout = Layout::new(points, frames, HEADER as u64, Scalar::F32Little);
    (layout.times.first, layout.times.step) = (first, step);
    Ok(layout)
}

/// A header for frames whose numbers begin at `first`, `step` apart.
pub(super) fn header(points: i32, frames: i32, first: f32, step: f32) -> Vec<u8> {
    let mut header = MAGIC.to_vec();
    header.extend(1_i32.to_le_bytes());
    header.extend(points.to_le_bytes());
    header.extend(first.to_le_bytes());
    header.extend(step.to_le_bytes());
    header.extend(frames.to_le_bytes());
    header
}
