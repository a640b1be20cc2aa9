//! Encodes arrays into a container.

use crate::apart::{Caller, apart};
use crate::arguments;
use crate::arrays::{frame_arrays, frame_views, model};
use crate::capture::Capture;
use crate::fault::{Fault, computing, of};
use crate::frames::Frames;
use crate::geometry::{cage, cage_mesh, design_goal, designed, of_rest, system};
use crate::handed_frames::{HandingFrames, Next};
use crate::meaning;
use crate::own_file::{OwnFile, WorkFolder, temporary};
use crate::watch::Watch;
use cager_cages::DesignOptions;
use cager_capture::coding::{Goal, suited_cage_size};
use cager_capture::design::{FRAMES, default_vertices, most_vertices, usual_options};
use cager_capture::encode::{Encode, EncodeError, EncodeProgress, Encoded, sample_frames};
use cager_capture::mismatch::cage_mismatch;
use cager_capture::origin::move_to;
use cager_core::cage::Cage;
use cager_core::coordinates::{CoordinateSystem, MeanValue};
use cager_core::inversion::PrepareError;
use cager_formats::{Action, Error, Target, Units};
use cager_geometry::mesh::{Model, Point, TriMesh};
use pyo3::prelude::*;

/// What is told before a cage is designed.
const ESTIMATING: &str = "estimating sizes of cages";

/// What is asked of an encoding.
#[derive(Clone, Copy)]
pub(crate) struct Asked {
    pub(crate) max_error: Option<f64>,
    pub(crate) mean_error: Option<f64>,
    pub(crate) vertices: Option<usize>,
    pub(crate) seed: u64,
    pub(crate) system: &'static dyn CoordinateSystem,
    pub(crate) frame_rate: Option<f64>,
    pub(crate) units: Units,
    pub(crate) force: bool,
}

impl Asked {
    /// Refuses what cannot be met, with a cage that was given or not.
    pub(crate) fn check(self, has_cage: bool) -> Result<(), Fault> {
        if has_cage && self.vertices.is_some() {
            return Err(of("vertices", "either they are given or cage; leave one of them out"));
        }
        self.goal(has_cage)?;
        if let Some(rate) = self.frame_rate.filter(|rate| !(rate.is_finite() && *rate > 0.0)) {
            return Err(of("frame_rate", format!("is {rate}; give a positive number of frames per second")));
        }
        Ok(())
    }

    /// What the file is to meet: a mean error is what a cage meets that is designed for it.
    pub(crate) fn goal(self, has_cage: bool) -> Result<Option<Goal>, Fault> {
        let fraction = |name, error: f64| {
            if error > 0.0 && error < 1.0 {
                return Ok(error);
            }
            Err(of(
                name,
                format!("is {error}; give a fraction of the rest pose's diagonal above 0 and below 1, such as 0.001"),
            ))
        };
        let max_error = self.max_error.map(|error| fraction("max_error", error)).transpose()?;
        let mean_error = self.mean_error.map(|error| fraction("mean_error", error)).transpose()?;
        match (max_error, mean_error) {
            (Some(_), Some(_)) => Err(of("max_error", "either it is given or mean_error; leave one of them out")),
            (Some(error), None) => Ok(Some(Goal::MaxError(error))),
            (None, error) => Ok(error.filter(|_| has_cage).map(Goal::MeanError)),
        }
    }
}

/// Encode a capture.
#[pyfunction]
#[pyo3(signature = (rest, faces, frames, cage=None, max_error=None, mean_error=None, progress=None, *, vertices=None, seed=0, coordinates="mvc", frame_rate=None, unit=None, up=None, start=None, times=None, force=false))]
#[expect(clippy::too_many_arguments, reason = "arguments with names")]
pub(crate) fn encode<'py>(
    py: Python<'py>,
    rest: &Bound<'py, PyAny>,
    faces: Option<&Bound<'py, PyAny>>,
    frames: &Bound<'py, PyAny>,
    cage: Option<(Bound<'py, PyAny>, Bound<'py, PyAny>)>,
    max_error: Option<f64>,
    mean_error: Option<f64>,
    progress: Option<Py<PyAny>>,
    #[pyo3(from_py_with = arguments::vertices)] vertices: Option<usize>,
    #[pyo3(from_py_with = arguments::seed)] seed: u64,
    coordinates: &str,
    frame_rate: Option<f64>,
    unit: Option<&Bound<'py, PyAny>>,
    up: Option<&str>,
    start: Option<f64>,
    times: Option<&Bound<'py, PyAny>>,
    force: bool,
) -> Result<Capture, Fault> {
    let mut rest = model(rest, faces, ["rest", "faces"])?;
    let mesh = cage.map(|(vertices, faces)| cage_mesh(&vertices, &faces)).transpose()?;
    let system = system(coordinates, "coordinates")?;
    let units = meaning::units(unit, up)?;
    let asked = Asked { max_error, mean_error, vertices, seed, system, frame_rate, units, force };
    // What is wrong with it is told before anything is computed.
    asked.check(mesh.is_some())?;
    let given = frame_arrays(frames, "frames")?;
    let views = frame_views(&given)?;
    let numbers = meaning::numbers(start, times, views.len())?;
    let watch = Watch::new(progress);
    let capture = computing(py, || {
        let mut frames = of_rest(&mut rest, &views, &watch);
        (frames.frame_rate, frames.numbers) = (frame_rate, numbers);
        frames.check(&rest, force)?;
        Capture::of_encoding(encoded(rest, mesh, &frames, asked, &watch)?)
    })?;
    capture.warn(py, 1)?;
    Ok(capture)
}

/// The container, in a file that goes when nobody needs it any more.
fn encoded(
    rest: Model,
    mesh: Option<TriMesh>,
    frames: &Frames<'_>,
    asked: Asked,
    watch: &Watch,
) -> Result<OwnFile, Fault> {
    let mut goal = asked.goal(mesh.is_some())?;
    let cage = match mesh {
        Some(mesh) => cage_of(&rest, mesh, frames.origin, asked.force)?,
        None => {
            let design = designed(&rest, frames, &design_options(&rest, frames, asked, goal, watch)?, watch)?;
            // What no cage meets is coded.
            if design.missed {
                goal = asked.goal(true)?;
            }
            cage(design.cage)?
        }
    };
    let folder = WorkFolder::new()?;
    let output = Target::New(folder.path().join("capture.cager"));
    let place = output.path().to_owned();
    let (system, origin, total) = (asked.system, frames.origin, frames.views.len().max(1) as f64);
    let written = folder.clone();
    let (mut handing, handed) = HandingFrames::new(frames.open());
    let work = move |caller: Caller<Next>| {
        let progress = |now| {
            // Reading stops where nobody waits any more.
            let _ = match now {
                EncodeProgress::Preparing(step) => caller.tell(step, 0.0),
                EncodeProgress::Frames(done) => caller.tell("encoding", done as f64 / total),
            };
        };
        let encode = Encode::new(&rest, &cage).coordinates(system).goal(goal).origin(origin).units(asked.units);
        let done = encode.progress(&progress).run(&mut handed(caller.clone()), &output);
        (done, written)
    };
    let (done, _written) = apart(watch, "coordinates", work, |next| handing.serve(next))?;
    done.and_then(Encoded::commit).map_err(named)?;
    let file = OwnFile::new(temporary()?.into_temp_path());
    let unmoved = |cause| Error::Io { path: file.path().to_owned(), action: Action::Write, cause };
    std::fs::rename(place, file.path()).map_err(unmoved)?;
    Ok(file)
}

/// A cage that was given, unless it looks like that of another model.
pub(crate) fn cage_of(rest: &Model, mut mesh: TriMesh, origin: Option<Point>, force: bool) -> Result<Cage, Fault> {
    move_to(origin, &mut mesh.vertices);
    let cage = cage(mesh.clone())?;
    match cage_mismatch(&mesh, rest).filter(|_| !force) {
        Some(what) => Err(of("cage", format!("{what}, or pass force=True to go on"))),
        None => Ok(cage),
    }
}

/// How a cage is designed, of as many vertices as suit what the file is to meet.
pub(crate) fn design_options(
    rest: &Model,
    frames: &Frames<'_>,
    asked: Asked,
    goal: Option<Goal>,
    watch: &Watch,
) -> Result<DesignOptions, Fault> {
    let is_mean_value = asked.system.name() == MeanValue.name();
    if asked.mean_error.is_some() && !is_mean_value {
        return Err(of(
            "mean_error",
            "is measured with mean value coordinates; give vertices, or leave coordinates out",
        ));
    }
    let mut vertices = asked.vertices;
    if let (Some(goal), None) = (goal, vertices) {
        let samples = sample_frames(&mut frames.open(), FRAMES, false).map_err(named)?;
        let (system, total, rest) = (asked.system, frames.views.len(), rest.clone());
        let work = move |_: Caller<()>| suited_cage_size(goal, system, &rest, None, &samples, total);
        vertices = apart(watch, ESTIMATING, work, |()| ())?.map(|suited| suited.vertices);
    }
    let vertices = vertices.or_else(|| {
        let usual = default_vertices(most_vertices(asked.system, rest.points.len()));
        asked.mean_error.is_none().then_some(usual)
    });
    let goal = design_goal(vertices, asked.mean_error, rest.points.len())?;
    Ok(DesignOptions { goal, seed: asked.seed, ..usual_options(asked.system) })
}

/// Errors know vertices and points; the user needs the argument.
fn named(error: EncodeError) -> Fault {
    match error {
        EncodeError::Prepare(error) => {
            let is_of_rest = matches!(
                error,
                PrepareError::NotFinite { .. }
                    | PrepareError::TooFewPoints { .. }
                    | PrepareError::NoExtent
                    | PrepareError::TooLarge
                    | PrepareError::NotReproduced { .. }
                    | PrepareError::TooFar { .. }
                    | PrepareError::OutOfMemory { .. }
            );
            of(if is_of_rest { "rest" } else { "cage" }, error)
        }
        other => Fault::Told(other.to_string()),
    }
}
