//! Caging by example: a cage whose coordinates reproduce a motion best.

mod adam;
mod contact;
mod descent;
mod exchange;
mod fit;
mod options;
mod parts;
mod rates;
mod run;
mod samples;
mod search;
mod symmetry;
mod topology;

use self::contact::{Distances, Obstacles};
pub use self::options::{Design, DesignError, DesignOptions, Goal, MAX_VERTICES, Progress, Stage, Style, Unseen};
pub use self::parts::Parts;
pub(crate) use self::rates::MEASURED;
pub use self::rates::{Rates, SuitedSize};
use self::run::{Best, Defects, Run};
pub(crate) use self::samples::Samples;
use self::symmetry::Symmetry;
use crate::enclose::enclose_watched;
use crate::thinned::Thinned;
use crate::{EncloseError, EncloseOptions};
use cager_core::cage::Cage;
use cager_geometry::mesh::{Model, TriMesh, diagonal};
use std::ops::ControlFlow;
use std::time::Instant;

/// Least distances, over the diagonal: of the model's points from the cage, and of parts of an
/// editable cage.
const CLEARANCE: f64 = 0.002;
const GAP: f64 = 0.002;

/// Designs a cage from a rest pose and frames of its motion, each with all points back to back:
/// made from some frames, chosen by others and judged by stretches that neither saw ([`Parts`]).
/// `start` is the cage to begin with. `watch` is called at least once a second, and may end the
/// design with the best cage so far. Runs on the current rayon pool.
///
/// # Errors
/// See [`DesignError`].
pub fn design(
    rest: &Model,
    frames: &[Vec<f64>],
    start: Option<&TriMesh>,
    options: &DesignOptions,
    watch: &mut dyn FnMut(Progress<'_>) -> ControlFlow<()>,
) -> Result<Design, DesignError> {
    check(rest, frames)?;
    if rest.points.is_empty() {
        return Err(EncloseError::Empty.into());
    }
    if diagonal(&rest.points) <= 0.0 {
        return Err(EncloseError::NoExtent.into());
    }
    if let Goal::MeanError(error) = options.goal
        && !(error.is_finite() && error > 0.0)
    {
        return Err(DesignError::BadGoal(error));
    }
    let clock = Instant::now();
    let enclosing = Progress { stage: "enclosing the rest pose", fraction: 0.0, error: None, better: None };
    if watch(enclosing).is_break() {
        return Err(DesignError::Stopped);
    }
    let vertices = match (start, options.goal) {
        (Some(start), _) => start.vertices.len(),
        (None, Goal::Vertices(vertices)) => vertices,
        (None, Goal::MeanError(_)) => search::first_vertices(rest.points.len()),
    };
    if vertices > MAX_VERTICES {
        return Err(DesignError::TooManyVertices(vertices));
    }
    let parts = Parts::of(frames.len());
    let sampled = || Samples::new(rest, frames, &parts, &mut fastrand::Rng::with_seed(options.seed));
    let mut samples = None;
    let mesh = rayon::in_place_scope(|scope| {
        // Meanwhile, as enclosing keeps one thread busy most of the time.
        scope.spawn(|_| samples = Some(sampled()));
        match start {
            Some(mesh) => Ok(mesh.clone()),
            None => {
                let options = EncloseOptions { vertices, ..EncloseOptions::default() };
                enclose_watched(rest, &options, &mut || watch(enclosing))
            }
        }
    });
    let mesh = mesh.map_err(|e| match e {
        EncloseError::Stopped => DesignError::Stopped,
        other => other.into(),
    })?;
    let samples = samples.unwrap_or_else(sampled);
    let symmetry = match options.symmetry {
        Some(axis) => Some(Symmetry::new(&mesh, axis).map_err(|vertex| DesignError::NotSymmetric { vertex, axis })?),
        None => None,
    };
    let cage = Cage::new(mesh)?;
    let defects = Defects::of(cage.mesh(), &rest.points);
    let obstacles = obstacles(rest, &defects.outside, options.style, symmetry);
    let valid = cage.mesh().clone();
    let best = Best { mesh: cage.mesh().clone(), evaluation: samples.evaluate(&cage) };
    let run = Run {
        rest,
        frames: (frames, &parts),
        samples: &samples,
        options,
        clock,
        watch,
        best,
        valid,
        defects,
        stages: Vec::new(),
        missed: false,
    };
    Ok(run.optimise(cage, obstacles))
}

/// The points inside the cage, of a large model some, and, for editable cages, the cage itself.
fn obstacles(rest: &Model, outside: &[u32], style: Style, symmetry: Option<Symmetry>) -> Obstacles {
    let diagonal = diagonal(&rest.points);
    let standing = Thinned::of(rest).map_or_else(|| (0..rest.points.len() as u32).collect(), |thin| thin.points);
    let inside = standing.iter().filter(|point| outside.binary_search(point).is_err());
    let inside = inside.map(|&point| rest.points[point as usize].into()).collect();
    let distances =
        Distances { clearance: CLEARANCE * diagonal, gap: (style == Style::Editable).then_some(GAP * diagonal) };
    Obstacles::new(inside, distances, symmetry)
}

pub(crate) fn check(rest: &Model, frames: &[Vec<f64>]) -> Result<(), DesignError> {
    if frames.is_empty() {
        return Err(DesignError::NoFrames);
    }
    for (frame, positions) in frames.iter().enumerate() {
        if positions.len() != 3 * rest.points.len() {
            return Err(DesignError::FrameSize { frame, found: positions.len() / 3, expected: rest.points.len() });
        }
        if let Some(i) = positions.iter().position(|c| !c.is_finite()) {
            return Err(DesignError::NotFinite { frame, point: i / 3 });
        }
    }
    Ok(())
}
