//! One animation of a template from surfaces that have no correspondence: files in, frames out that can be encoded as any capture.

mod any_subject;
mod finish;
mod people;
mod placement;
mod positions;
mod report;
mod surfaces;

pub use people::{Joints, Person};
pub use placement::Placement;
pub use positions::RecoveredFrames;
pub use report::{FrameReport, RecoveryReport};
pub use surfaces::Distances;

use crate::mismatch::Up;
use any_subject::Recovering;
use cager_core::cage::{Cage, CageError};
use cager_core::coordinates::{CoordinateSystem, CoordinatesError, MeanValue};
use cager_formats::MeshSequence;
use cager_geometry::mesh::{Model, Point, TriMesh};
use cager_recover::joints::JointsError;
use cager_recover::people::ModelError;
use cager_registration::{ObservationError, RegistrationError, outward};
use finish::Finisher;
use report::Seconds;
use std::path::{Path, PathBuf};
use std::sync::mpsc::sync_channel;
use std::time::Instant;
use surfaces::{Followed, SurfaceFiles};

/// Why a recovery stopped; nothing was written.
#[derive(Debug, thiserror::Error)]
pub enum RecoverError {
    /// A file cannot be read, or the scratch file not be written.
    #[error(transparent)]
    Formats(#[from] cager_formats::Error),
    /// A file holds no surface that can be followed.
    #[error("{}: frame {frame}: {cause}; or go on without such frames with --force", .path.display())]
    Surface {
        /// The file.
        path: PathBuf,
        /// Its place, counted from 0.
        frame: usize,
        /// What is wrong with it.
        cause: ObservationError,
    },
    /// No frame can be followed.
    #[error("none of {frames} files holds a surface that can be followed; the first: {first}")]
    NoSurface {
        /// Files.
        frames: usize,
        /// What is wrong with the first.
        first: String,
    },
    /// The template cannot be laid onto anything.
    #[error(transparent)]
    Template(#[from] RegistrationError),
    /// The template cannot be followed by its rig.
    #[error(transparent)]
    Person(#[from] ModelError),
    /// The joints have no place in the cage.
    #[error(transparent)]
    Joints(#[from] JointsError),
    /// The cage cannot be used.
    #[error("the cage: {0}")]
    Cage(#[from] CageError),
    /// Coordinates cannot be computed.
    #[error(transparent)]
    Coordinates(#[from] CoordinatesError),
    /// The template lies better when turned.
    #[error("{}: the template lies on this first surface better when it is turned by {degrees:.0} degrees; add --align auto, or --up where another axis points up, or --force to go on as it is", .path.display())]
    Turned {
        /// The file of the first surface.
        path: PathBuf,
        /// By how much.
        degrees: f64,
    },
    /// The template has another size.
    #[error("{}: this first surface is {scale:.3} times as large as the template; add --scale auto, or --force to go on as it is", .path.display())]
    OtherSize {
        /// The file of the first surface.
        path: PathBuf,
        /// How much larger it is.
        scale: f64,
    },
}

/// What a recovery may do.
#[derive(Clone, Copy, Debug)]
pub struct RecoverOptions {
    /// Turn and move the template onto the first surface.
    pub align: bool,
    /// Scale it to the first surface.
    pub scale: bool,
    /// The axis that points up in the frames, where another one does in the template.
    pub up: Option<Up>,
    /// Let vertices leave the cage to meet the surfaces.
    pub offsets: bool,
    /// Go on past frames that hold no surface, and where the template seems turned or of another size.
    pub force: bool,
    /// Points of each surface that are looked at.
    pub points: usize,
}

/// Everything a recovery needs.
pub struct RecoverJob<'a> {
    /// The template, with faces.
    pub template: Model,
    /// Its cage.
    pub cage: Cage,
    /// What is known of it, where it is a person: the cage is then the rig's.
    pub person: Option<Person<'a>>,
    /// The frames.
    pub files: &'a MeshSequence,
    /// Frames per second, where known.
    pub frame_rate: Option<f64>,
    /// Subtracted from the frames, as it was from the template and its cage.
    pub origin: Option<Point>,
    /// What it may do.
    pub options: RecoverOptions,
    /// A folder for frames on their way; nothing stays there that is not removed with it.
    pub scratch: &'a Path,
}

/// How far a recovery is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RecoverProgress {
    /// So many frames were followed from the first.
    Followed(usize),
    /// So many were looked at again from the last.
    Refined(usize),
}

/// A recovered animation.
pub struct Recovered {
    /// The template where the frames are.
    pub rest: Model,
    /// Its cage there.
    pub cage: Cage,
    /// Its points in every frame.
    pub frames: RecoveredFrames,
    /// How it went.
    pub report: RecoveryReport,
    /// Joints of a person in every frame.
    pub joints: Option<Joints>,
    /// What the user should know.
    pub warnings: Vec<String>,
}

/// Follows a template through surfaces.
///
/// # Errors
/// See [`RecoverError`].
pub fn recover(job: RecoverJob<'_>, progress: &dyn Fn(RecoverProgress)) -> Result<Recovered, RecoverError> {
    let clock = Instant::now();
    let RecoverJob { mut template, cage, person, files, frame_rate, origin, options, scratch } = job;
    let frames = files.files.len();
    let numbers = files.numbers.clone().unwrap_or_else(|| (0..frames).map(|k| k as f64).collect());
    let diagonal = |model: &Model| cager_geometry::mesh::diagonal(&model.points);
    let mut surfaces =
        SurfaceFiles { files: &files.files, points: options.points, diagonal: diagonal(&template), origin };
    let first = first_surface(&surfaces, options.force)?;
    let mut cage = cage.mesh().clone();
    let seen = surfaces.read(first)?;
    let placement = Placement::find(&mut template, &mut cage, &seen.observation, &options)?;
    surfaces.diagonal = diagonal(&template);
    let cage = Cage::new(cage)?;
    let mut rest = TriMesh::from(&template);
    rest.triangles = outward(&rest.vertices, &rest.triangles);
    let written = RecoveredFrames::create(scratch, rest.vertices.len(), numbers.clone(), frame_rate)?;
    let mut finisher = Finisher::new(&rest, surfaces.diagonal, options.offsets, written);
    let mut seconds = Seconds::default();
    let (mut joints, mut warnings) = (None, Vec::new());
    let mut reports = if let Some(person) = person {
        seconds.prepare = clock.elapsed().as_secs_f64();
        let clock = Instant::now();
        let found = person.follow(&rest, &surfaces, &mut finisher, options.force, progress)?;
        seconds.follow = clock.elapsed().as_secs_f64();
        joints = Some(found.joints);
        found.reports
    } else {
        let coordinates = MeanValue.coordinates(&cage, &template.points, None)?;
        if !coordinates.outside.is_empty() {
            let outside = coordinates.outside.len();
            warnings.push(format!("{outside} points of the template lie outside of the cage, and follow it less well"));
        }
        let model = Recovering::new(&rest, &cage, &coordinates.phi)?;
        if placement.is_none() && !options.force {
            model.check_start(&template, &rest, &cage, (&files.files[first], &seen))?;
        }
        drop(seen);
        seconds.prepare = clock.elapsed().as_secs_f64();
        let clock = Instant::now();
        let mut tracked = model.follow(&surfaces, &cage, options.force, progress)?;
        seconds.follow = clock.elapsed().as_secs_f64();
        let clock = Instant::now();
        let reports = model.refine(&surfaces, &mut tracked, &mut finisher, options.force, progress)?;
        seconds.refine = clock.elapsed().as_secs_f64();
        reports
    };
    for ((report, &number), file) in reports.iter_mut().zip(&numbers).zip(&files.files) {
        (report.number, report.file) = (number, file.clone());
    }
    let report = RecoveryReport::new((&rest, &cage), surfaces.diagonal, placement, reports, seconds);
    warnings.extend(report.warnings());
    warnings.extend(placement.and_then(|placement| placement.warning()));
    let frames = finisher.into_frames()?;
    Ok(Recovered { rest: template, cage, frames, report, joints, warnings })
}

/// The first frame that holds a surface.
fn first_surface(surfaces: &SurfaceFiles<'_>, force: bool) -> Result<usize, RecoverError> {
    let mut first_error = None;
    for frame in 0..surfaces.files.len() {
        match surfaces.read(frame) {
            Ok(_) => return Ok(frame),
            Err(error) if !force || !matches!(error, RecoverError::Surface { .. }) => return Err(error),
            Err(error) => {
                first_error.get_or_insert(error);
            }
        }
    }
    let first = first_error.map_or_else(String::new, |error| error.to_string());
    Err(RecoverError::NoSurface { frames: surfaces.files.len(), first })
}

/// Calls `work` with frames in an order, each read while the one before is worked on; with nothing for those that hold no surface, where that is allowed.
fn each(
    surfaces: &SurfaceFiles<'_>,
    order: Vec<usize>,
    force: bool,
    mut work: impl FnMut(usize, Option<Followed>) -> Result<(), RecoverError>,
) -> Result<(), RecoverError> {
    std::thread::scope(|scope| {
        let (send, read) = sync_channel(1);
        scope.spawn(move || {
            for frame in order {
                // Nobody waits where the work failed.
                if send.send((frame, surfaces.follow(frame))).is_err() {
                    break;
                }
            }
        });
        for (frame, seen) in read {
            match seen {
                Ok(seen) => work(frame, Some(seen))?,
                Err(RecoverError::Surface { .. }) if force => work(frame, None)?,
                Err(error) => return Err(error),
            }
        }
        Ok(())
    })
}
