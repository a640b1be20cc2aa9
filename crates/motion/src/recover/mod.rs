//! One animation of a template from surfaces without correspondence: files in, frames out.

mod any_subject;
mod colors;
mod departures;
mod distances;
mod encoding;
mod finish;
mod gait;
mod people;
mod placement;
mod positions;
mod report;
mod source;
mod spread;
mod start;
mod surfaces;

pub use departures::Departure;
pub use distances::Distances;
pub use encoding::Encoding;
pub use gait::GaitCurve;
pub use gait::gait_svg;
pub use people::{JOINTS_RATE, manifold_of, rig_of};
pub use people::{Joints, Person};
use placement::check_start;
pub use placement::{Placement, placed_units};
pub use positions::RecoveredFrames;
pub use report::{FrameReport, RecoveryReport};
pub use source::{Arrival, SurfaceSource};
pub use start::as_large;
pub use surfaces::observed;

use any_subject::Recovering;
use cager_cages::{EncloseError, enclose_apart};
use cager_capture::design::default_vertices;
use cager_core::cage::{Cage, CageError};
use cager_core::coordinates::{CoordinateSystem, CoordinatesError, MeanValue};
use cager_geometry::mesh::{Model, Point, TriMesh};
use cager_geometry::units::Up;
use cager_shape::people::ModelError;
use cager_shape::people::joints::JointsError;
use cager_shape::registration::{ObservationError, RegistrationError, Template, outward};
use finish::{Finisher, Written};
use report::Seconds;
use start::check_surface;
use std::path::{Path, PathBuf};
use std::time::Instant;
use surfaces::Surfaces;

/// Why a recovery stopped; nothing was written.
#[derive(Debug, thiserror::Error)]
pub enum RecoverError {
    /// A file cannot be read, or the scratch file not be written.
    #[error(transparent)]
    Formats(#[from] cager_formats::Error),
    /// It was told to stop.
    #[error("the recovery was stopped")]
    Stopped,
    /// A stored file cannot be read.
    #[error("{0}")]
    Stored(String),
    /// A file without mesh or cloud, that is empty, or has coordinates that are not finite.
    #[error("{0}; or go on without such frames with --force")]
    Unusable(cager_formats::Error),
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
    #[error("{}: this first surface is {} the template; add --scale auto, or --force to go on as it is", .path.display(), as_large(*.scale))]
    OtherSize {
        /// The file of the first surface.
        path: PathBuf,
        /// How much larger it is.
        scale: f64,
    },
    /// The template of a person, which is not scaled, has quite another size.
    #[error("{}: this first surface is {} the template; scale one of them, or add --force to go on as it is", .path.display(), as_large(*.scale))]
    OtherPerson {
        /// The file of the first surface.
        path: PathBuf,
        /// How much larger it is.
        scale: f64,
    },
    /// The template is not where the first surface is.
    #[error("{}: this first surface lies {distance:.3} away from the template, {diagonals:.1} times its diagonal; add --align auto, or --force to go on as it is", .path.display())]
    Elsewhere {
        /// The file of the first surface.
        path: PathBuf,
        /// From middle to middle, in the frames' unit.
        distance: f64,
        /// The same in diagonals of the template.
        diagonals: f64,
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
    /// Go on past frames without a surface, and where the template seems turned or of another size.
    pub force: bool,
    /// Points of each surface that are looked at.
    pub points: usize,
    /// Give the template the colours of the surfaces, where these have some.
    pub colors: bool,
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
    pub source: &'a dyn SurfaceSource,
    /// Threads that read and fit; the usual ones without.
    pub pool: Option<&'a rayon::ThreadPool>,
    /// Frames per second, where known.
    pub frame_rate: Option<f64>,
    /// Subtracted from the frames, as it was from the template and its cage.
    pub origin: Option<Point>,
    /// What it may do.
    pub options: RecoverOptions,
    /// A folder for frames on their way; nothing stays there that is not removed with it.
    pub scratch: &'a Path,
}

/// A frame of the first pass.
#[derive(Clone, Copy, Debug)]
pub struct FirstLook<'a> {
    /// Its place, from 0.
    pub frame: usize,
    /// Vertices of the cage.
    pub cage: &'a [Point],
    /// Joints of a person; none of any other subject.
    pub joints: &'a [Point],
    /// How well the template lies on the surface, as in a [`FrameReport`].
    pub score: Option<f64>,
    /// How it was found, as in a [`FrameReport`].
    pub outcome: &'static str,
}

/// How far a recovery is.
#[derive(Clone, Copy, Debug)]
pub enum RecoverProgress<'a> {
    /// A frame was followed; they come in their order.
    Followed(FirstLook<'a>),
    /// So many were looked at again from the last.
    Refined(usize),
}

/// Who is told how far a recovery is.
pub type Watch<'a> = dyn Fn(RecoverProgress<'_>) + Sync + 'a;

/// A recovered animation.
pub struct Recovered {
    /// The template where the frames are.
    pub rest: Model,
    /// Its cage there.
    pub cage: Cage,
    /// Its points in every frame.
    pub frames: RecoveredFrames,
    /// Its cage in every frame.
    pub cages: Vec<Vec<Point>>,
    /// How it went.
    pub report: RecoveryReport,
    /// Joints of a person in every frame.
    pub joints: Option<Joints>,
    /// What the user should know.
    pub warnings: Vec<String>,
}

/// A cage for a template that comes without.
///
/// # Errors
/// No cage can be made around it.
pub fn cage_around(template: &Model) -> Result<TriMesh, EncloseError> {
    enclose_apart(template, default_vertices(template.points.len()))
}

/// Frames of which all is known.
struct Finished {
    reports: Vec<FrameReport>,
    cages: Vec<Vec<Point>>,
    joints: Option<Joints>,
    written: Written,
}

/// Follows a template through surfaces.
///
/// # Errors
/// See [`RecoverError`].
pub fn recover(job: RecoverJob<'_>, watch: &Watch<'_>) -> Result<Recovered, RecoverError> {
    let clock = Instant::now();
    let RecoverJob { mut template, cage, person, source, pool, frame_rate, origin, options, scratch } = job;
    let diagonal = |model: &Model| cager_geometry::mesh::diagonal(&model.points);
    let RecoverOptions { points, force, colors, .. } = options;
    let mut surfaces = Surfaces { source, pool, points, diagonal: diagonal(&template), origin, force, colors };
    let (first, seen) = surfaces.first()?;
    let mut cage = cage.mesh().clone();
    let placement = surfaces.on_pool(|| Placement::find(&mut template, &mut cage, &seen.observation, &options))?;
    surfaces.diagonal = diagonal(&template);
    if !force {
        let (file, is_person) = (source.file(first), person.is_some());
        surfaces.on_pool(|| check_surface(&template, (&file, &seen.observation), &options, is_person))?;
    }
    let cage = Cage::new(cage)?;
    let mut rest = TriMesh::from(&template);
    rest.triangles = outward(&rest.vertices, &rest.triangles);
    let finisher = |frames: usize| {
        let numbers = source.numbers(frames).unwrap_or_else(|| (0..frames).map(|k| k as f64).collect());
        let written = RecoveredFrames::create(scratch, rest.vertices.len(), numbers, frame_rate)?;
        Ok(Finisher::new(&rest, source, surfaces.diagonal, options.offsets, written))
    };
    let mut seconds = Seconds::default();
    let mut warnings = Vec::new();
    let Finished { reports, cages, joints, written } = if let Some(person) = person {
        seconds.prepare = clock.elapsed().as_secs_f64();
        let clock = Instant::now();
        let found = person.follow(&rest, &surfaces, &finisher, watch)?;
        seconds.follow = clock.elapsed().as_secs_f64();
        found
    } else {
        let coordinates = surfaces.on_pool(|| MeanValue.coordinates(&cage, &template.points, None))?;
        if !coordinates.outside.is_empty() {
            let outside = coordinates.outside.len();
            warnings.push(format!("{outside} points of the template lie outside of the cage, and follow it less well"));
        }
        let model = surfaces.on_pool(|| {
            let phi = &coordinates.phi;
            let model = Recovering { phi, template: Template::new(&rest, &cage, phi.as_ref(), 0)? };
            if placement.is_none() && !force {
                check_start(&template, &rest, &cage, &model, (&source.file(first), &seen.observation))?;
            }
            Ok::<_, RecoverError>(model)
        })?;
        drop(seen);
        seconds.prepare = clock.elapsed().as_secs_f64();
        let clock = Instant::now();
        let tracked = model.follow(&surfaces, &cage, watch)?;
        seconds.follow = clock.elapsed().as_secs_f64();
        let clock = Instant::now();
        let finisher = finisher(tracked.len())?;
        let found = model.refine(&surfaces, tracked, finisher, watch)?;
        seconds.refine = clock.elapsed().as_secs_f64();
        found
    };
    let Written { frames, departures, colors: found } = written;
    let found_all = (reports, departures);
    let mut report = RecoveryReport::new((&rest, &cage), surfaces.diagonal, placement, found_all, seconds);
    match &joints {
        Some(joints) => report.gait = joints.gait(),
        None => report.find_change(),
    }
    warnings.extend(report.warnings());
    warnings.extend(placement.and_then(|placement| placement.warning()));
    match found {
        Some(found) => template.colors = found,
        None if colors => warnings.push("no frame has colours, so the template keeps its own".to_owned()),
        None => {}
    }
    Ok(Recovered { rest: template, cage, frames, cages, report, joints, warnings })
}
