//! Sampling evenly spaced frames of an uploaded capture, one read at a time.

use crate::file_bodies::{TELLING_BYTES, instead_of_numbers};
use crate::problem::{self, ApiError};
use cager_formats::{CacheFormat, Error, FrameReader, open_frames_in, open_raw_frames};
use std::io::{Read, Seek};
use std::path::Path;

/// Most frames that a design samples; more hardly improve it.
const MAX_SAMPLED_FRAMES: usize = 160;

/// Number of frames to sample within `max_bytes` of memory; 0 if not even one fits.
pub(super) fn sampled(frames: usize, points: usize, max_bytes: u64) -> usize {
    let room = max_bytes / (24 * points.max(1) as u64);
    frames.min(MAX_SAMPLED_FRAMES).min(usize::try_from(room).unwrap_or(usize::MAX))
}

/// Opens uploaded frames: a point cache if the file name's extension says so, otherwise raw little-endian f32, which need the option
/// `frames`.
///
/// # Errors
/// A length or a number of points that does not match.
pub(crate) fn open<'a>(
    name: &str,
    mut source: impl Read + Seek + Send + 'a,
    bytes: u64,
    points: usize,
    announced: Option<u32>,
) -> Result<Box<dyn FrameReader + 'a>, ApiError> {
    let path = Path::new(name);
    if let Some(format) = CacheFormat::from_path(path) {
        if matches!(format, CacheFormat::Glb | CacheFormat::Gltf | CacheFormat::Fbx) {
            // They are read as a whole, and may be many times larger in memory.
            let kind = if format == CacheFormat::Fbx { "FBX" } else { "glTF" };
            return Err(mismatch(format!(
                "frames: {name} is {kind}, which is not taken here; send .npy, .abc or .usdc"
            )));
        }
        let reader = open_frames_in(format, path, source, bytes, points).map_err(|error| unreadable(&error))?;
        return match announced.filter(|&announced| announced as usize != reader.frames()) {
            None => Ok(reader),
            Some(announced) => Err(mismatch(format!(
                "options.frames is {announced}, but {name} has {} frames; leave the option out",
                reader.frames()
            ))),
        };
    }
    refuse_file(path, &mut source, points)?;
    let Some(frames) = announced else {
        let detail = "frames: the part has no name ending in .npy, so it is raw numbers; say how many frames it has as options.frames";
        return Err(ApiError::new(problem::INVALID_OPTIONS, detail));
    };
    let expected = u64::from(frames).saturating_mul(12 * points as u64);
    if bytes != expected {
        return Err(mismatch(format!(
            "frames: {frames} frames of {points} points are {expected} bytes, but {bytes} were sent; send x y z of every point as f32, frame after frame"
        )));
    }
    open_raw_frames(path, source, bytes, points, frames).map_err(|error| unreadable(&error))
}

/// Refuses a file in place of raw numbers.
fn refuse_file(path: &Path, source: &mut impl Read, points: usize) -> Result<(), ApiError> {
    let mut start = Vec::new();
    let read = source.take(12 * points as u64).take(TELLING_BYTES as u64).read_to_end(&mut start);
    read.map_err(|cause| unreadable(&Error::Io { path: path.to_owned(), action: cager_formats::Action::Read, cause }))?;
    let refuse = |what| Err(mismatch(format!("frames: the part {what}; a .npy file is sent under its name")));
    instead_of_numbers(&start).map_or(Ok(()), refuse)
}

/// Reads `count` evenly spaced frames, including the first and the last, and passes each to `each` with its number.
///
/// # Errors
/// A frame that cannot be read, or has a coordinate that is NaN or infinite.
pub(super) fn read(
    reader: &mut dyn FrameReader,
    count: usize,
    mut each: impl FnMut(usize, &[f64]),
) -> Result<(), ApiError> {
    let last = reader.frames() - 1;
    let mut next = 0;
    let mut frame = Vec::new();
    for k in 0..count {
        let wanted = if count > 1 { k * last / (count - 1) } else { 0 };
        while next < wanted {
            reader.skip().map_err(|error| unreadable(&error))?;
            next += 1;
        }
        if !reader.read_next(&mut frame).map_err(|error| unreadable(&error))? {
            return Err(mismatch("frames: there are fewer than announced; send them again".to_owned()));
        }
        next += 1;
        each(wanted, &frame);
    }
    Ok(())
}

fn mismatch(detail: String) -> ApiError {
    ApiError::new(problem::INVALID_FRAME, detail)
}

fn unreadable(error: &Error) -> ApiError {
    let refused = mismatch(format!("frames: {error}"));
    match error {
        Error::NonFinite { frame, .. } => refused.frame(u32::try_from(*frame).unwrap_or(u32::MAX)),
        Error::Io { cause, .. } if cause.kind() != std::io::ErrorKind::UnexpectedEof => ApiError::internal(error),
        _ => refused,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Cursor;

    fn raw(frames: u32, points: usize) -> Vec<u8> {
        (0..frames).flat_map(|t| vec![t as f32; 3 * points]).flat_map(f32::to_le_bytes).collect()
    }

    #[test]
    fn evenly_spaced_frames_are_read_with_the_first_and_the_last() {
        let bytes = raw(11, 2);
        let length = bytes.len() as u64;
        for (count, expected) in [(1, vec![0.0]), (2, vec![0.0, 10.0]), (3, vec![0.0, 5.0, 10.0])] {
            let mut reader = open("frames", Cursor::new(&bytes), length, 2, Some(11)).expect("frames");
            let mut found = Vec::new();
            read(&mut *reader, count, |_, frame| found.push(frame[0])).expect("frames");
            assert_eq!(found, expected);
        }
    }

    #[test]
    fn memory_bounds_the_number_of_frames() {
        assert_eq!(sampled(1000, 1000, 1 << 30), 160);
        assert_eq!(sampled(20, 1000, 1 << 30), 20);
        assert_eq!(sampled(1000, 1000, 240_000), 10);
        assert_eq!(sampled(1000, 1000, 23_999), 0);
    }

    #[test]
    fn raw_numbers_of_another_length_are_refused() {
        let bytes = raw(3, 2);
        for (frames, points) in [(4, 2), (3, 3), (2, 2)] {
            let refused = open("frames.f32", Cursor::new(&bytes), bytes.len() as u64, points, Some(frames));
            assert!(refused.is_err_and(|error| error.problem.detail.contains("72 were sent")));
        }
        assert!(open("frames", Cursor::new(&bytes), bytes.len() as u64, 2, None).is_err());
    }
}
