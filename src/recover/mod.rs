//! One animation of a template from surfaces that have no correspondence: files in, frames out that can be encoded as any capture.

mod placement;
mod positions;
mod report;
mod surfaces;

pub use placement::Placement;
pub use positions::RecoveredFrames;
pub use report::{FrameReport, RecoveryReport};
pub use surfaces::Distances;

use crate::mismatch::Up;
use cager_core::cage::{Cage, CageError};
use cager_core::coordinates::{CoordinateSystem, CoordinatesError, MeanValue};
use cager_formats::MeshSequence;
use cager_geometry::linalg::tall_product;
use cager_geometry::mesh::{Model, Point, TriMesh};
use cager_recover::offsets::OffsetSolver;
use cager_recover::track::{SecondPass, TrackedFrame, Tracker, smoothed};
use cager_registration::{
    ObservationError, RegistrationError, SurfacePoint, Template, TemplateOptions, outward, sample_surface,
};
use faer::Mat;
use placement::{area, check_start};
use report::Seconds;
use std::collections::VecDeque;
use std::path::{Path, PathBuf};
use std::sync::mpsc::sync_channel;
use std::time::Instant;
use surfaces::{Followed, SurfaceFiles, distances};

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
    /// The frames.
    pub files: &'a MeshSequence,
    /// Frames per second, where known.
    pub frame_rate: Option<f64>,
    /// Number of the first frame, where it is not in the names of the files.
    pub first_number: f64,
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
    /// What the user should know.
    pub warnings: Vec<String>,
}

/// Follows a template through surfaces.
///
/// # Errors
/// See [`RecoverError`].
pub fn recover(job: RecoverJob<'_>, progress: &dyn Fn(RecoverProgress)) -> Result<Recovered, RecoverError> {
    let clock = Instant::now();
    let RecoverJob { mut template, cage, files, frame_rate, first_number, options, scratch } = job;
    let frames = files.files.len();
    let numbers = files.numbers.clone().unwrap_or_else(|| (0..frames).map(|k| first_number + k as f64).collect());
    let diagonal = |model: &Model| cager_geometry::mesh::diagonal(&model.points);
    let mut surfaces = SurfaceFiles { files: &files.files, points: options.points, diagonal: diagonal(&template) };
    let first = first_surface(&surfaces, options.force)?;
    let mut cage = cage.mesh().clone();
    let seen = surfaces.read(first)?;
    let placement = Placement::find(&mut template, &mut cage, &seen.observation, &options);
    surfaces.diagonal = diagonal(&template);
    let cage = Cage::new(cage)?;
    let coordinates = MeanValue.coordinates(&cage, &template.points, None)?;
    let mut rest = TriMesh::from(&template);
    rest.triangles = outward(&rest.vertices, &rest.triangles);
    let prepared = Template::new(&rest, &cage, coordinates.phi.as_ref(), &TemplateOptions::default())?;
    let model = Recovering { rest: &rest, phi: &coordinates.phi, template: &prepared, diagonal: surfaces.diagonal };
    if placement.is_none() && !options.force {
        let target = cager_registration::Target::new(&seen.observation, surfaces.diagonal);
        let area_of = |cage: &[Point]| area(&model.positions(cage), &rest.triangles);
        check_start(&template, &cage, &prepared, area_of, (&files.files[first], &seen.observation, &target))?;
    }
    drop(seen);
    let mut seconds = Seconds { prepare: clock.elapsed().as_secs_f64(), ..Seconds::default() };

    let clock = Instant::now();
    let mut tracker = Tracker::new(&prepared, cage.vertices().to_vec());
    let mut tracked: Vec<TrackedFrame> = Vec::with_capacity(frames);
    each(&surfaces, (0..frames).collect(), options.force, |_, seen| {
        tracked.push(match seen {
            Some(seen) => tracker.follow(&seen.target),
            None => tracker.skip(),
        });
        progress(RecoverProgress::Followed(tracked.len()));
        Ok(())
    })?;
    seconds.follow = clock.elapsed().as_secs_f64();

    let clock = Instant::now();
    let mut written = RecoveredFrames::create(scratch, rest.vertices.len(), numbers.clone(), frame_rate)?;
    let reports = model.refine(&surfaces, &mut tracked, &mut written, &options, progress)?;
    written.rewind()?;
    seconds.refine = clock.elapsed().as_secs_f64();

    let report = RecoveryReport::new(&rest, &cage, surfaces.diagonal, placement, reports, &numbers, files, seconds);
    let mut warnings = report.warnings();
    warnings.extend(placement.and_then(|placement| placement.warning()));
    if !coordinates.outside.is_empty() {
        let outside = coordinates.outside.len();
        warnings.push(format!("{outside} points of the template lie outside of the cage, and follow it less well"));
    }
    Ok(Recovered { rest: template, cage, frames: written, report, warnings })
}

/// The first frame that holds a surface.
fn first_surface(surfaces: &SurfaceFiles<'_>, force: bool) -> Result<usize, RecoverError> {
    let mut first_error = None;
    for frame in 0..surfaces.files.len() {
        match surfaces.read(frame) {
            Ok(_) => return Ok(frame),
            Err(error) if !force => return Err(error),
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
                Err(_) if force => work(frame, None)?,
                Err(error) => return Err(error),
            }
        }
        Ok(())
    })
}

/// A template that is followed.
struct Recovering<'a> {
    rest: &'a TriMesh,
    phi: &'a Mat<f64>,
    template: &'a Template,
    diagonal: f64,
}

/// Points of the template that are measured to the surfaces.
const MEASURED: usize = 3000;

impl Recovering<'_> {
    /// Where the template's points are in a cage.
    fn positions(&self, cage: &[Point]) -> Vec<Point> {
        let cage = Mat::from_fn(cage.len(), 3, |i, k| cage[i][k]);
        let found = tall_product(self.phi.as_ref(), cage.as_ref());
        (0..found.nrows()).map(|i| std::array::from_fn(|k| found[(i, k)])).collect()
    }

    /// The second pass, from the last frame: frames that lay badly from the frame after them, smoothed between their neighbours, measured and written.
    fn refine(
        &self,
        surfaces: &SurfaceFiles<'_>,
        tracked: &mut [TrackedFrame],
        written: &mut RecoveredFrames,
        options: &RecoverOptions,
        progress: &dyn Fn(RecoverProgress),
    ) -> Result<Vec<FrameReport>, RecoverError> {
        let pass = SecondPass::new(self.template, tracked);
        let offsets =
            options.offsets.then(|| OffsetSolver::new(self.rest, self.diagonal));
        let samples = sample_surface(&self.rest.vertices, &self.rest.triangles, MEASURED, 1);
        let mut reports: VecDeque<FrameReport> = VecDeque::with_capacity(tracked.len());
        let mut finish = |frame: usize, seen: Option<&Followed>, tracked: &[TrackedFrame]| {
            let mut positions = self.positions(&tracked[frame].cage);
            if let (Some(offsets), Some(seen)) = (&offsets, seen) {
                positions = offsets.offset(&positions, &seen.target);
            }
            reports.push_front(self.measure(&tracked[frame], positions.clone(), &samples, seen));
            written.write(frame, &positions)?;
            progress(RecoverProgress::Refined(reports.len()));
            Ok::<_, RecoverError>(())
        };
        // The frame after the one that is looked at, which waits for its other neighbour.
        let mut waiting: Option<(usize, Option<Followed>)> = None;
        each(surfaces, (0..tracked.len()).rev().collect(), options.force, |frame, seen| {
            if let Some(seen) = seen.as_ref().filter(|_| pass.wants(&tracked[frame])) {
                let (at, after) = tracked[frame..].split_at_mut(1);
                let after: Vec<&[Point]> = after.iter().take(2).map(|frame| &frame.cage[..]).collect();
                pass.refit(&seen.target, &mut at[0], &after);
            }
            if let Some((later, at)) = waiting.replace((frame, seen)) {
                if let (Some(at), Some(beyond)) = (&at, tracked.get(later + 1)) {
                    let beside = [&tracked[frame].cage[..], &beyond.cage[..]];
                    let cage = smoothed(self.template, &at.target, &tracked[later].cage, beside);
                    tracked[later].cage = cage;
                }
                finish(later, at.as_ref(), tracked)?;
            }
            Ok(())
        })?;
        if let Some((frame, seen)) = waiting {
            finish(frame, seen.as_ref(), tracked)?;
        }
        Ok(reports.into())
    }

    fn measure(
        &self,
        frame: &TrackedFrame,
        positions: Vec<Point>,
        samples: &[SurfacePoint],
        seen: Option<&Followed>,
    ) -> FrameReport {
        let mesh = TriMesh { vertices: positions, triangles: self.rest.triangles.clone() };
        let points: Vec<Point> = samples.iter().map(|sample| sample.at(&mesh.vertices, &mesh.triangles)).collect();
        let (to_surface, from_surface) =
            seen.map_or((None, None), |seen| distances(&mesh, &points, seen, self.diagonal));
        let turned = seen.is_some_and(|seen| seen.notes.turned);
        let estimated_normals = seen.is_some_and(|seen| seen.notes.estimated_normals);
        FrameReport::new(frame, to_surface, from_surface, turned, estimated_normals)
    }
}
