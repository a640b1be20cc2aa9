//! Checks before an encoding or a design that rest pose, cage and capture match. A mismatch is an
//! error, or a warning with --force.

use super::{warn, warning};
use anyhow::Result;
use cager_capture::checks;
use cager_capture::encode::EncodeError;
use cager_capture::frames::{CaptureFiles, Hints};
use cager_capture::mismatch::Mismatch;
use cager_capture::timing::Timing;
use cager_core::cage::CageError;
use cager_formats::Error::{PointCount, SeveralSequences};
use cager_formats::{FrameSelection, RATES};
use cager_geometry::mesh::{Model, TriMesh};
use cager_geometry::units::Up;
use clap::Args;
use std::path::{Path, PathBuf};

/// How a capture is read, where its files do not tell.
#[derive(Args, Debug)]
pub(crate) struct CaptureArgs {
    #[command(flatten)]
    pub(super) checks: CheckArgs,

    /// Axis that points up in the capture, where another one does in the rest pose: frames are
    /// turned to the rest pose's axes.
    #[arg(long = "up", id = "capture_up", value_name = "AXIS", value_parser = up)]
    pub(super) up: Option<Up>,

    /// Merge the points of the rest pose that seams split (flat shading, UVs); frames are read split or merged.
    #[arg(long)]
    pub(super) weld: bool,

    #[command(flatten)]
    pub(super) timing: TimingArgs,
}

/// What is accepted of a capture.
#[derive(Args, Debug)]
pub(crate) struct CheckArgs {
    /// The meshes to take of Alembic archives, USD files, glTF and FBX (rest pose and capture):
    /// paths, such as /walk/body, names, or globs of these, such as '/walk/**/eye*'; may be given
    /// several times [default: all that are rendered]. An only mesh is taken whatever it is called.
    /// Of .npz with several arrays that fit, the name of one.
    #[arg(long, value_name = "PATH", hide_default_value = true)]
    pub(super) prim: Vec<String>,

    /// Frames to take for each second of an animated .glb, .gltf or .fbx, which has keys instead of
    /// frames [default: those at its keys; of .fbx at the rate of its scene].
    #[arg(long, value_name = "F", value_parser = rate, allow_negative_numbers = true, hide_default_value = true)]
    pub(super) sample_rate: Option<f64>,

    /// The animation to take of a .glb, .gltf or .fbx with several: its name, or its number from 0
    /// [default: the first that moves the mesh].
    #[arg(long, value_name = "NAME", hide_default_value = true)]
    pub(super) animation: Option<String>,

    /// Go on where numbers are missing from the names of the capture's files.
    #[arg(long)]
    pub(super) allow_gaps: bool,

    /// Take all files where their names look like several sequences, in natural order: poses with
    /// names of their own, say.
    #[arg(long)]
    pub(super) all_files: bool,

    /// Go on where rest pose, cage and capture look as if they did not belong together: other
    /// units, axes, handedness or order of points.
    #[arg(long)]
    pub(super) force: bool,
}

/// When frames are.
#[derive(Args, Debug)]
pub(crate) struct TimingArgs {
    /// Frames per second [default: what the files tell].
    #[arg(long, value_name = "F", value_parser = rate, allow_negative_numbers = true, hide_default_value = true)]
    pub(super) fps: Option<f64>,

    /// Number of the first frame [default: what the files tell].
    #[arg(long, value_name = "T", value_parser = frame_number, allow_negative_numbers = true,
          hide_default_value = true)]
    pub(super) start: Option<f64>,
}

pub(super) fn up(text: &str) -> Result<Up, String> {
    match text {
        "y" => Ok(Up::Y),
        "z" => Ok(Up::Z),
        _ => Err("give y or z".to_owned()),
    }
}

fn rate(text: &str) -> Result<f64, String> {
    let found = text.parse().ok().filter(|rate: &f64| RATES.contains(rate));
    found.ok_or_else(|| "give a number of frames per second from 0.001 to 1,000,000".to_owned())
}

fn frame_number(text: &str) -> Result<f64, String> {
    let found = text.parse().ok().filter(|number: &f64| number.abs() < 1e9);
    found.ok_or_else(|| "give the number of a frame".to_owned())
}

impl From<&TimingArgs> for Timing {
    fn from(args: &TimingArgs) -> Self {
        Self { fps: args.fps, start: args.start }
    }
}

/// The files of a capture for a rest pose of so many points; `no_frames` are the files of the rest pose and the cage.
pub(super) fn checked_files<'a>(
    args: &CheckArgs,
    path: &Path,
    points: usize,
    no_frames: impl IntoIterator<Item = &'a PathBuf>,
) -> CaptureFiles {
    let mut files = CaptureFiles { path: path.to_owned(), points, ..unnamed_files(args) };
    files.selection.no_frames = no_frames.into_iter().cloned().collect();
    files
}

/// How the files of a capture are read.
pub(super) fn unnamed_files(args: &CheckArgs) -> CaptureFiles {
    CaptureFiles {
        allow_gaps: args.allow_gaps,
        selection: FrameSelection {
            join_sequences: args.all_files,
            prims: args.prim.clone(),
            rate: args.sample_rate,
            animation: args.animation.clone(),
            ..FrameSelection::default()
        },
        hints: Hints { mismatch: FORCE, gaps: ", or pass --allow-gaps to go on without them" },
        ..CaptureFiles::default()
    }
}

const FORCE: &str = ", or pass --force to go on";

/// Compares the frames of a capture with its rest pose, for a command without --up and --weld.
pub(super) fn check_capture(files: &mut CaptureFiles, rest: (&Path, &Model), args: &CheckArgs) -> Result<()> {
    warning(|warnings| checks::check_frames(files, rest, args.force, warnings))
        .map_err(|error| explained(error, &files.path, false))
}

/// Checks whether a cage is one of this model.
pub(super) fn check_cage(cage: (&Path, &TriMesh), rest: &Model, args: &CheckArgs) -> Result<()> {
    warning(|warnings| checks::check_cage(cage, rest, args.force, warnings))
        .map_err(|error| explained_cage(error, false))
}

/// What to do about a capture, in the options of a command that has --up, --unit and --weld, whose --up is given.
pub(super) fn explained_with_options(
    error: EncodeError,
    frames: &Path,
    up: Option<Up>,
    is_flipped: bool,
) -> anyhow::Error {
    match error {
        EncodeError::Mismatch { what, found } => match found.first() {
            // It turns the capture to the rest pose's axes, which may be its own.
            Some(Mismatch::Axes(Some(found))) if up.is_some() => {
                anyhow::anyhow!("{what}; leave out --up, or pass --up {}{FORCE}", found.name())
            }
            Some(Mismatch::Axes(Some(found))) => anyhow::anyhow!("{what}; pass --up {}{FORCE}", found.name()),
            Some(Mismatch::Units(_)) => {
                anyhow::anyhow!(
                    "{what}; give --unit and --up for files that do not say theirs, or scale one of them{FORCE}"
                )
            }
            _ => explained(EncodeError::Mismatch { what, found }, frames, is_flipped),
        },
        EncodeError::Seams { rest, cause: PointCount { path: capture, expected, found, .. } } => anyhow::anyhow!(
            "{}: has {found} points where {} has {expected}, {} of them doubles along seams that flat shading or UVs \
             split; pass --weld",
            capture.display(),
            rest.display(),
            expected as u64 - found
        ),
        error => explained(error, frames, is_flipped),
    }
}

/// What to do about a capture, in the options of any command that reads one.
pub(super) fn explained(error: EncodeError, frames: &Path, is_flipped: bool) -> anyhow::Error {
    match error {
        error @ EncodeError::EndsEarly { .. } => anyhow::anyhow!("{}: {error}", frames.display()),
        EncodeError::Seams { cause, .. } => cause.into(),
        EncodeError::Formats(error @ SeveralSequences { .. }) => {
            anyhow::anyhow!("{error}; or pass --all-files to take them all, in natural order")
        }
        error => explained_cage(error, is_flipped),
    }
}

/// What to do about a cage, which --flip-cage has turned around.
pub(super) fn explained_cage(error: EncodeError, is_flipped: bool) -> anyhow::Error {
    match error {
        EncodeError::Cage { path, cause: CageError::Inward { .. } } if is_flipped => anyhow::anyhow!(
            "{}: turned around, the faces of the cage point inwards; leave out --flip-cage",
            path.display()
        ),
        error @ EncodeError::Cage { cause: CageError::Inward { .. }, .. } => {
            anyhow::anyhow!("{error}, or pass --flip-cage")
        }
        error @ EncodeError::Mismatch { .. } => anyhow::anyhow!("{error}{FORCE}"),
        other => other.into(),
    }
}

/// Warns of frames that were read although they do not look like those before.
pub(super) fn warn_of_departures(files: &CaptureFiles) {
    let noted = files.belonging.as_ref().and_then(|belonging| belonging.noted());
    warn(noted.map(str::to_owned).as_slice());
}
