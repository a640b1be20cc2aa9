//! Checks before an encoding or a design that rest pose, cage and capture match. A mismatch is an error, or a warning with --force.

use super::dry_run::read_files;
use super::warn;
use anyhow::{Result, bail};
use cager_cages::diagnosis::weld;
use cager_capture::belonging::Belonging;
use cager_capture::encode::{EncodeError, sample_frames};
use cager_capture::frames::CaptureFiles;
use cager_capture::mismatch::{self, Mismatch, cage_mismatch, mismatches};
use cager_capture::timing::Timing;
use cager_formats::RATES;
use cager_geometry::mesh::{Model, TriMesh, diagonal};
use cager_geometry::units::Up;
use clap::Args;
use std::path::{Path, PathBuf};

/// How a capture is read, where its files do not tell.
#[derive(Args, Debug)]
pub(crate) struct CaptureArgs {
    #[command(flatten)]
    pub(super) checks: CheckArgs,

    /// Axis that points up in the capture, where another one does in the rest pose: frames are turned to the rest pose's axes.
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
    /// The mesh to take of Alembic archives, USD files and glTF (rest pose and capture) with several: its path, such as /walk/body, or its name. An only mesh is taken
    /// whatever it is called, and of glTF all meshes as one where nothing is said. Of .npz with several arrays that fit, the name of one.
    #[arg(long, value_name = "PATH")]
    pub(super) prim: Option<String>,

    /// Frames to take for each second of an animated .glb or .gltf, which has keys instead of frames [default: those at its keys].
    #[arg(long, value_name = "F", value_parser = rate, allow_negative_numbers = true, hide_default_value = true)]
    pub(super) sample_rate: Option<f64>,

    /// The animation to take of a .glb or .gltf with several: its name, or its number from 0 [default: the first that moves the mesh].
    #[arg(long, value_name = "NAME", hide_default_value = true)]
    pub(super) animation: Option<String>,

    /// Go on where numbers are missing from the names of the capture's files.
    #[arg(long)]
    pub(super) allow_gaps: bool,

    /// Take all files where their names look like several sequences, in natural order: poses with names of their own, say.
    #[arg(long)]
    pub(super) all_files: bool,

    /// Go on where rest pose, cage and capture look as if they did not belong together: other units, axes, handedness or order of points.
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
    #[arg(long, value_name = "T", value_parser = frame_number, allow_negative_numbers = true, hide_default_value = true)]
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
    let mut files = CaptureFiles::new(path, points);
    files.allow_gaps = args.allow_gaps;
    files.selection.no_frames = no_frames.into_iter().cloned().collect();
    files.selection.join_sequences = args.all_files;
    files.selection.prim.clone_from(&args.prim);
    files.selection.rate = args.sample_rate;
    files.selection.animation.clone_from(&args.animation);
    files
}

/// The files of a capture for a rest pose, which is welded first if it should be.
pub(super) fn capture_files<'a>(
    args: &CaptureArgs,
    path: &Path,
    rest: &mut Model,
    no_frames: impl IntoIterator<Item = &'a PathBuf>,
) -> CaptureFiles {
    let mut files = checked_files(&args.checks, path, rest.points.len(), no_frames);
    files.timing = (&args.timing).into();
    files.up = args.up;
    if let Some(welded) = args.weld.then(|| weld(rest)).flatten() {
        *rest = welded.model;
        files.points = rest.points.len();
        files.weld = Some(welded.target);
    }
    files
}

/// Compares some frames of a capture with its rest pose, and has the others compared as they are read; `turns` where the command has --up and --weld.
pub(super) fn check_capture(
    files: &mut CaptureFiles,
    rest: (&Path, &Model),
    args: &CheckArgs,
    turns: bool,
) -> Result<()> {
    let opened = files.open().map_err(EncodeError::from);
    let frames = opened.and_then(|mut reader| {
        warn(&reader.notes());
        sample_frames(reader.as_mut(), mismatch::FRAMES, false)
    });
    let frames = frames.map_err(|error| explained(error, files, rest, turns))?;
    warn(single_far_away(files, rest.1, &frames).as_slice());
    let found = mismatches(rest.1, &frames);
    if found.is_empty() {
        files.belonging = Belonging::new(rest, args.force);
        if files.belonging.as_ref().is_some_and(|belonging| belonging.suspects(&frames)) {
            // Told before the work, and of the first one.
            read_files(files)?;
        }
        return Ok(());
    }
    let advice = match found[0] {
        // It turns the capture to the rest pose's axes, which may be its own.
        Mismatch::Axes(Some(up)) if turns && files.up.is_some() => {
            format!("leave out --up, or pass --up {}", up.name())
        }
        Mismatch::Axes(Some(up)) if turns => format!("pass --up {}", up.name()),
        Mismatch::Order(_) => "export both from one program with the order of the points kept".to_owned(),
        Mismatch::Axes(_) => "export both with the same axes".to_owned(),
        Mismatch::Units(_) if turns => {
            "give --unit and --up for files that do not say theirs, or scale one of them".to_owned()
        }
        Mismatch::Units(_) => "scale one of them".to_owned(),
        Mismatch::Mirrored(mirroring) => Mismatch::mirrored_advice(mirroring),
    };
    let words: Vec<String> = found.iter().map(ToString::to_string).collect();
    let what = format!(
        "{}: does not look like a capture of {}: {}",
        files.path.display(),
        rest.0.display(),
        words.join(", and ")
    );
    refuse_or_warn(what, &format!("; {advice}"), args.force)
}

/// Checks a cage that leaves most points outside, or is far larger than the model, for other units or axes and for belonging to another model.
pub(super) fn check_cage(cage: (&Path, &TriMesh), rest: &Model, args: &CheckArgs) -> Result<()> {
    let Some(what) = cage_mismatch(cage.1, rest) else { return Ok(()) };
    refuse_or_warn(format!("{}: {what}", cage.0.display()), "", args.force)
}

/// What is to be said of frames that lost digits before they came here: in single precision, as far away as their rest pose.
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

/// Warns of frames that were read although they do not look like those before.
pub(super) fn warn_of_departures(files: &CaptureFiles) {
    let noted = files.belonging.as_ref().and_then(|belonging| belonging.noted());
    warn(noted.map(str::to_owned).as_slice());
}

fn refuse_or_warn(what: String, advice: &str, force: bool) -> Result<()> {
    if !force {
        bail!("{what}{advice}, or pass --force to go on");
    }
    warn(&[what]);
    Ok(())
}

/// Explains a wrong number of points where welding seams would make it right.
fn explained(error: EncodeError, files: &CaptureFiles, (path, rest): (&Path, &Model), welds: bool) -> anyhow::Error {
    use cager_formats::Error::{PointCount, SeveralSequences};
    match error {
        EncodeError::Formats(PointCount { path: ref capture, expected, found, .. })
            if welds && weld(rest).is_some_and(|welded| welded.model.points.len() as u64 == found) =>
        {
            anyhow::anyhow!(
                "{}: has {found} points where {} has {expected}, {} of them doubles along seams that flat shading or UVs split; pass --weld",
                capture.display(),
                path.display(),
                expected as u64 - found
            )
        }
        error @ EncodeError::EndsEarly { .. } => anyhow::anyhow!("{}: {error}", files.path.display()),
        EncodeError::Formats(error @ SeveralSequences { .. }) => {
            anyhow::anyhow!("{error}; or pass --all-files to take them all, in natural order")
        }
        other => other.into(),
    }
}
