//! `--dry-run`: checks and reports without writing anything.

use super::{counted, grouped, human_bytes, progress, tell};
use anyhow::Result;
use cager_capture::encode::EncodeError;
use cager_capture::frames::CaptureFiles;
use cager_formats::{FrameReader, Target};

/// Reads every frame, so that what is wrong with any of them is told.
pub(super) fn read_all(frames: &mut dyn FrameReader) -> Result<usize, EncodeError> {
    let bar = progress::frames("reading", frames.frames());
    let (announced, mut found, mut frame) = (frames.frames(), 0, Vec::new());
    while frames.read_next(&mut frame)? {
        found += 1;
        bar.set_position(found as u64);
    }
    bar.finish_and_clear();
    if found < announced {
        return Err(EncodeError::EndsEarly { found, announced });
    }
    Ok(found)
}

/// [`read_all`] of the files of a capture; errors name them.
pub(super) fn read_files(files: &CaptureFiles) -> Result<usize> {
    let read = files.open().map_err(EncodeError::from).and_then(|mut frames| read_all(frames.as_mut()));
    read.map_err(|error| match error {
        EncodeError::EndsEarly { .. } => anyhow::anyhow!("{}: {error}", files.path.display()),
        other => other.into(),
    })
}

/// Says what would be written: what the main output holds, and which others there are.
pub(super) fn tell_dry_run(output: &Target, what: &str, others: &[Option<Target>]) -> Result<()> {
    let mut text = format!("{}: would be written: {what}\n", output.path().display());
    for target in others.iter().flatten() {
        text += &format!("{}: would be written\n", target.path().display());
    }
    tell(&text)
}

/// `20 frames of 600 points, about 144.0 kB`: what frames take in single precision.
pub(super) fn size(frames: usize, rows: usize, of: &str) -> String {
    let bytes = 12 * frames as u64 * rows as u64;
    format!("{} of {} {of}, about {}", counted(frames, "frame"), grouped(rows), human_bytes(bytes))
}
