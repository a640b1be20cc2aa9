//! Caging by example: a cage whose coordinates reproduce a motion best.

mod adam;
mod contact;
mod descent;
mod exchange;
mod fit;
mod run;
mod samples;
mod search;
mod symmetry;
mod topology;

use self::contact::{Distances, Obstacles};
use self::run::{Best, Defects, Run};
use self::samples::Samples;
use self::symmetry::Symmetry;
use crate::enclose::enclose_unless;
use crate::{EncloseError, EncloseOptions};
use cager_core::cage::{Cage, CageError};
use cager_geometry::mesh::{Model, TriMesh, diagonal};
use cager_geometry::spatial::outside;
use std::ops::ControlFlow;
use std::time::{Duration, Instant};

/// Least distances that a design keeps, as fractions of the diagonal: between the model's points and the cage, and between parts of a
/// cage for editing.
const CLEARANCE: f64 = 0.002;
const GAP: f64 = 0.002;
/// Vertices of a designed cage at most.
pub const MOST_VERTICES: usize = 1_500;

/// What a cage is designed to be.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Style {
    /// Whatever reproduces the motion best: it may cut itself. For compression and viewing.
    #[default]
    Free,
    /// Closed, free of self-intersection and enclosing, and smooth: to be edited by hand.
    Editable,
}

/// What decides the number of vertices.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Goal {
    /// At most so many vertices.
    Vertices(usize),
    /// As few vertices as keep the mean L2 error on held-back frames at or below this fraction of the diagonal.
    MeanError(f64),
}

/// How a cage is designed.
#[derive(Clone, Debug, PartialEq)]
pub struct DesignOptions {
    /// Number of vertices, or the error to reach.
    pub goal: Goal,
    /// Free or editable.
    pub style: Style,
    /// Random seed: the same seed gives the same result, unless the time limit ends the design.
    pub seed: u64,
    /// The design ends with the best cage so far when this has passed.
    pub time_limit: Option<Duration>,
    /// Keep the connectivity of the cage to start with, so that only its vertices move; the goal is then ignored.
    pub keep_connectivity: bool,
    /// Keep the cage to start with symmetric across the plane of this axis (0, 1, 2 for x, y, z), and so its connectivity too.
    pub symmetry: Option<usize>,
}

impl Default for DesignOptions {
    fn default() -> Self {
        Self {
            goal: Goal::Vertices(350),
            style: Style::Free,
            seed: 0,
            time_limit: None,
            keep_connectivity: false,
            symmetry: None,
        }
    }
}

/// Progress of a design.
#[derive(Clone, Copy, Debug)]
pub struct Progress<'a> {
    /// What is being done, in a few words.
    pub stage: &'static str,
    /// How much of the work is done, from 0 to 1.
    pub fraction: f64,
    /// Mean L2 error on held-back frames of the best cage so far, as a fraction of the diagonal; `None` before the first.
    pub error: Option<f64>,
    /// The best cage so far, where it is another one than at the call before.
    pub better: Option<&'a TriMesh>,
}

/// Result of one stage of a design.
#[derive(Clone, Debug, PartialEq)]
pub struct Stage {
    /// What was done.
    pub name: String,
    /// Vertices after it.
    pub vertices: usize,
    /// Mean L2 error after it on the frames that the design sees, as a fraction of the diagonal.
    pub designed: f64,
    /// The same on the frames that it does not see.
    pub held_back: f64,
    /// Condition number of the coordinates after it, infinite where they are singular; `None` where it was not computed.
    pub condition_number: Option<f64>,
    /// Seconds since the design began.
    pub seconds: f64,
}

/// A designed cage.
#[derive(Clone, Debug, PartialEq)]
pub struct Design {
    /// The cage.
    pub cage: TriMesh,
    /// What each stage brought, in order. The last holds the final errors.
    pub stages: Vec<Stage>,
    /// Whether the time limit ended it.
    pub timed_out: bool,
    /// What a user should know.
    pub warnings: Vec<String>,
}

/// Why no cage can be designed.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum DesignError {
    /// The rest pose cannot be enclosed.
    #[error(transparent)]
    Enclose(#[from] EncloseError),
    /// A frame of another size than the rest pose.
    #[error(
        "frame {frame} has {found} points where the rest pose has {expected}; capture and rest pose are different meshes"
    )]
    FrameSize {
        /// The frame, counted among those given.
        frame: usize,
        /// Points it has.
        found: usize,
        /// Points of the rest pose.
        expected: usize,
    },
    /// NaN or infinity.
    #[error("frame {frame}: point {point} has a coordinate that is NaN or infinite; repair the frame or leave it out")]
    NotFinite {
        /// The frame, counted among those given.
        frame: usize,
        /// The point.
        point: usize,
    },
    /// No frames.
    #[error("a cage cannot be designed from no frames; give some, or make one from the rest pose alone")]
    NoFrames,
    /// Cancelled before there was a cage.
    #[error("the design was stopped before it had a cage")]
    Stopped,
    /// The mesh to start with is not a usable cage.
    #[error("the cage to start with cannot be used: {0}")]
    Start(#[from] CageError),
    /// The cage to start with is not symmetric.
    #[error("cage vertex {vertex} has no mirror image along {axis}; choose another axis, or make the cage symmetric first", axis = ["x", "y", "z"][*.axis])]
    NotSymmetric {
        /// A vertex without a mirror image.
        vertex: usize,
        /// The axis, 0 to 2.
        axis: usize,
    },
    /// More vertices than a design is made for: each step takes the cube of their number.
    #[error(
        "a cage is designed with at most {most} vertices, not {vertices}; ask for fewer, or make one from the rest pose alone"
    )]
    TooManyVertices {
        /// What was asked for, or what the cage to start with has.
        vertices: usize,
        /// What is possible.
        most: usize,
    },
    /// A goal that no cage can reach.
    #[error("a mean error of {0} cannot be a goal; give a fraction of the diagonal above 0, such as 0.001")]
    BadGoal(f64),
}

/// Designs a cage from a rest pose and frames of its motion, each with the points of the rest pose back to back: some of the frames
/// (every second one) are held back to judge by. `start`, where given, is the cage to begin with. `watch` is called with the progress at least once a
/// second; it may end the design, whose result is then the best cage so far. Runs on the current rayon pool.
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
    if vertices > MOST_VERTICES {
        return Err(DesignError::TooManyVertices { vertices, most: MOST_VERTICES });
    }
    let mesh = match start {
        Some(mesh) => mesh.clone(),
        None => {
            let options = EncloseOptions { vertices, ..EncloseOptions::default() };
            enclose_unless(rest, &options, &mut || watch(enclosing).is_break()).map_err(|e| match e {
                EncloseError::Stopped => DesignError::Stopped,
                other => other.into(),
            })?
        }
    };
    let symmetry = match options.symmetry {
        Some(axis) => Some(Symmetry::new(&mesh, axis).map_err(|vertex| DesignError::NotSymmetric { vertex, axis })?),
        None => None,
    };
    let cage = Cage::new(mesh)?;
    let samples = Samples::new(rest, frames, &mut fastrand::Rng::with_seed(options.seed));
    let obstacles = obstacles(rest, &cage, options.style, symmetry);
    let defects = Defects::of(cage.mesh(), &rest.points);
    let best = Best { mesh: cage.mesh().clone(), evaluation: samples.evaluate(&cage) };
    let run = Run {
        rest,
        samples: &samples,
        obstacles: &obstacles,
        options,
        clock,
        watch,
        best,
        defects,
        stages: Vec::new(),
    };
    Ok(run.optimise(cage, frames))
}

/// The obstacles: the points inside the cage and, for editable cages, the cage itself.
fn obstacles(rest: &Model, cage: &Cage, style: Style, symmetry: Option<Symmetry>) -> Obstacles {
    let diagonal = diagonal(&rest.points);
    let mut is_outside = vec![false; rest.points.len()];
    for (i, _) in outside(cage.mesh(), &rest.points) {
        is_outside[i as usize] = true;
    }
    let inside = rest.points.iter().zip(is_outside).filter(|(_, outside)| !outside).map(|(&p, _)| p.into()).collect();
    let distances =
        Distances { clearance: CLEARANCE * diagonal, gap: (style == Style::Editable).then_some(GAP * diagonal) };
    Obstacles::new(inside, distances, symmetry)
}

fn check(rest: &Model, frames: &[Vec<f64>]) -> Result<(), DesignError> {
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
