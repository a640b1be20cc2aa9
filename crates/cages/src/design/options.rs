//! What a design is asked for, tells on its way, and gives.

use crate::EncloseError;
use cager_core::cage::{Cage, CageError, Carrier};
use cager_geometry::mesh::TriMesh;
use std::ops::Range;
use std::time::Duration;

/// Vertices of a designed cage at most.
pub const MAX_VERTICES: usize = 1_500;

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
    /// As few vertices as keep the mean L2 error on the choosing frames below this share of the
    /// diagonal.
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
    /// Keep the connectivity of the cage to start with; the goal is then ignored.
    pub keep_connectivity: bool,
    /// Keep the cage symmetric across the plane of this axis (0, 1, 2), and so its connectivity
    /// too.
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
    /// Root mean square error of the best cage on the choosing frames, over the diagonal; `None` at
    /// first.
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
    /// Root mean square error after it on the frames that are designed from, over the diagonal.
    pub training_error: f64,
    /// The same on the frames between them, by which the best cage is chosen.
    pub validation_error: f64,
    /// Condition number of the coordinates, infinite where singular; `None` where not computed.
    pub condition_number: Option<f64>,
    /// Seconds since the design began.
    pub seconds: f64,
}

/// What a cage does on stretches of time that neither its design nor its choice saw.
#[derive(Clone, Debug, PartialEq)]
pub struct Unseen {
    /// Root mean square error, as a fraction of the diagonal.
    pub error: f64,
    /// The stretches, among the frames given.
    pub stretches: Vec<Range<usize>>,
}

/// A designed cage.
#[derive(Clone, Debug, PartialEq)]
pub struct Design {
    /// The cage.
    pub cage: TriMesh,
    /// Which component of it carries which points; empty where the whole cage carries all.
    pub carriers: Vec<Carrier>,
    /// What each stage brought, in order. The last holds the final errors.
    pub stages: Vec<Stage>,
    /// How it does where nothing of it was chosen by; `None` of too few frames to hold some back.
    pub unseen: Option<Unseen>,
    /// Whether the time limit ended it.
    pub timed_out: bool,
    /// Whether the error that was asked for is not met.
    pub missed: bool,
    /// What a user should know.
    pub warnings: Vec<String>,
}

impl Design {
    /// The cage with its components.
    ///
    /// # Errors
    /// See [`CageError`].
    pub fn into_cage(self) -> Result<Cage, CageError> {
        Cage::new(self.cage)?.with_carriers(self.carriers)
    }
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
        "a cage is designed with at most {MAX_VERTICES} vertices, not {0}; ask for fewer, or make one from the rest pose alone"
    )]
    TooManyVertices(usize),
    /// A goal that no cage can reach.
    #[error("a mean error of {0} cannot be a goal; give a fraction of the diagonal above 0, such as 0.001")]
    BadGoal(f64),
}
