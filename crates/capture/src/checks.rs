//! Whether rest pose, cage and frames belong together: a mismatch is an error, or a warning where
//! it is allowed.

use crate::belonging::Belonging;
use crate::encode::{EncodeError, sample_frames};
use crate::frames::CaptureFiles;
use crate::mismatch::{self, cage_mismatch, mismatches};
use cager_cages::diagnosis::weld;
use cager_formats::Error::PointCount;
use cager_geometry::mesh::{Model, TriMesh, diagonal};
use std::path::Path;

/// Compares some frames with their rest pose, and lets the others be compared as they are read.
///
/// # Errors
/// [`EncodeError::Mismatch`] unless it is allowed, [`EncodeError::Seams`], and frames that cannot
/// be read.
pub fn check_frames(
    files: &mut CaptureFiles,
    (path, rest): (&Path, &Model),
    allow_mismatch: bool,
    warnings: &mut Vec<String>,
) -> Result<(), EncodeError> {
    let opened = files.open().map_err(EncodeError::from);
    let frames = opened.and_then(|mut reader| {
        warnings.extend(reader.notes());
        files.shown = reader.shown();
        if rest.surface.picture_names().next().is_some() {
            files.pictures = reader.pictures();
        }
        sample_frames(reader.as_mut(), mismatch::FRAMES, false)
    });
    let frames = frames.map_err(|error| explained(error, (path, rest)))?;
    warnings.extend(single_far_away(files, rest, &frames));
    let found = mismatches(rest, &frames);
    if found.is_empty() {
        files.belonging = Belonging::new((path, rest), allow_mismatch, files.hints.mismatch);
        if files.belonging.as_ref().is_some_and(|belonging| belonging.suspects(&frames)) {
            // Told before the work, and of the first one.
            let (mut reader, mut frame) = (files.open()?, Vec::new());
            while reader.read_next(&mut frame)? {}
        }
        return Ok(());
    }
    let words: Vec<String> = found.iter().map(ToString::to_string).collect();
    let (frames, rest) = (files.path.display(), path.display());
    let what = format!("{frames}: does not look like a capture of {rest}: {}", words.join(", and "));
    refuse_or_warn(EncodeError::Mismatch { what, found }, allow_mismatch, warnings)
}

/// Checks a cage that leaves most points outside, or is far larger than the model, for other units
/// or axes and for belonging to another model.
///
/// # Errors
/// [`EncodeError::Mismatch`] unless it is allowed.
pub fn check_cage(
    (path, cage): (&Path, &TriMesh),
    rest: &Model,
    allow_mismatch: bool,
    warnings: &mut Vec<String>,
) -> Result<(), EncodeError> {
    let Some(what) = cage_mismatch(cage, rest) else { return Ok(()) };
    let what = format!("{}: {what}", path.display());
    refuse_or_warn(EncodeError::Mismatch { what, found: Vec::new() }, allow_mismatch, warnings)
}

fn refuse_or_warn(error: EncodeError, allow: bool, warnings: &mut Vec<String>) -> Result<(), EncodeError> {
    match error {
        EncodeError::Mismatch { what, .. } if allow => warnings.push(what),
        error => return Err(error),
    }
    Ok(())
}

/// What is to be said of frames that lost digits before they came here: in single precision, as far
/// away as their rest pose.
fn single_far_away(files: &CaptureFiles, rest: &Model, frames: &[Vec<f64>]) -> Option<String> {
    const MAX_ROUNDING_ERROR: f64 = 1e-5;
    let origin = files.origin?;
    let farthest = origin.iter().fold(0.0, |far: f64, x| far.max(x.abs()));
    let lost = farthest * f64::from(f32::EPSILON) / 2.0 / diagonal(&rest.points);
    let is_single = |(x, o): (&f64, &f64)| f64::from((x + o) as f32) == x + o;
    let singles = frames.iter().all(|frame| frame.iter().zip(origin.iter().cycle()).all(is_single));
    (lost > MAX_ROUNDING_ERROR && singles).then(|| {
        format!(
            "{}: its frames are in single precision, which so far from the origin has lost what is smaller than {lost:.1e} of the rest pose's diagonal; export them in double precision (float64)",
            files.path.display()
        )
    })
}

/// Explains a wrong number of points where welding seams would make it right.
fn explained(error: EncodeError, (path, rest): (&Path, &Model)) -> EncodeError {
    match error {
        EncodeError::Formats(cause @ PointCount { found, .. })
            if weld(rest).is_some_and(|welded| welded.model.points.len() as u64 == found) =>
        {
            EncodeError::Seams { rest: path.to_owned(), cause }
        }
        other => other,
    }
}
