//! The JSON bodies of cage design: what is asked for at `POST /v1/cages`, and what becomes of it.

pub use crate::messages::JobState as CageState;
use crate::messages::Problem;
use crate::options::options;
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

options! {
    /// The JSON part `options` of `POST /v1/cages`. What is left out has its default.
    pub struct CageOptions {
        /// A name for people, at most 200 characters.
        #[schema(max_length = 200)]
        name: Option<String>,
        /// Most vertices of the cage; 350 where neither this nor `mean_error` is given.
        #[schema(minimum = 4, maximum = 20000)]
        vertices: Option<u32>,
        /// Instead of `vertices`: as few as keep the mean L2 error on frames that the design does
        /// not see at or below this fraction of the rest pose's diagonal.
        #[schema(exclusive_minimum = 0)]
        mean_error: Option<f64>,
        /// Coordinate system that the cage is designed for: `mvc`.
        #[schema(pattern = "^mvc$")]
        coordinates: Option<String>,
        /// `free` (the default): whatever reproduces the motion best; or `editable`: enclosing,
        /// without self-intersection, and smooth.
        style: Option<CageStyle>,
        /// Seed of what is drawn at random; 0 where it is left out.
        seed: Option<u64>,
        /// Seconds after which the best cage is the result; by default what the service allows.
        #[schema(exclusive_minimum = 0)]
        time_limit_s: Option<f64>,
        /// Number of frames in the part `frames`; needed where those are raw numbers.
        #[schema(minimum = 1)]
        frames: Option<u32>,
    }
}

/// What a cage is designed for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, Serialize, ToSchema)]
#[serde(rename_all = "lowercase")]
pub enum CageStyle {
    /// Compression and viewing.
    #[default]
    Free,
    /// Editing by hand.
    Editable,
}

/// Mean L2 errors of a cage as fractions of the rest pose's diagonal.
#[derive(Clone, Copy, Debug, Default, PartialEq, Deserialize, Serialize, ToSchema)]
#[serde(default)]
pub struct CageError {
    /// On the frames that the design is made from; null until a stage is done.
    pub designed: Option<f64>,
    /// On the frames between them, by which the best cage is chosen.
    pub held_back: Option<f64>,
    /// Of the final cage on stretches of time that neither saw; null where frames are few.
    pub unseen: Option<f64>,
}

/// What one stage of a design brought.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize, ToSchema)]
pub struct CageStage {
    /// What was done.
    pub name: String,
    /// Vertices of the cage after it.
    pub vertices: u32,
    /// Errors after it.
    pub error: CageError,
    /// Condition number of the coordinates after it; null where singular or not computed.
    pub condition_number: Option<f64>,
    /// Whether the coordinates were singular after it.
    #[serde(default)]
    pub singular: bool,
    /// Seconds since the design began.
    pub seconds: f64,
}

/// The design of a cage.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize, ToSchema)]
pub struct CageJob {
    /// Identifier, part of every address below it.
    pub id: String,
    /// Name given at creation.
    pub name: Option<String>,
    /// What it is doing.
    pub state: CageState,
    /// Creation time, seconds since 1970.
    pub created: f64,
    /// Points of the model.
    pub points: u32,
    /// Frames that were sent.
    pub frames: u32,
    /// How many of them, evenly spaced, the design looks at.
    pub sampled_frames: u32,
    /// Vertices of the best cage so far; null before the first.
    pub vertices: Option<u32>,
    /// Triangles of the best cage so far.
    pub faces: Option<u32>,
    /// What is being done, in a few words; null while it waits and when it is over.
    pub stage: Option<String>,
    /// How much of the work is done, from 0 to 1.
    #[schema(minimum = 0, maximum = 1)]
    pub fraction: f64,
    /// Errors of the best cage so far.
    pub error: CageError,
    /// What each stage brought; empty until the cage is completed.
    pub stages: Vec<CageStage>,
    /// How long the design has taken.
    pub seconds: f64,
    /// Whether the time limit ended it.
    pub timed_out: bool,
    /// What a user should know but that did not stop the work.
    pub warnings: Vec<String>,
    /// Why there is no cage.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub problem: Option<Problem>,
}

/// A page of designs, newest first.
#[derive(Clone, Debug, Default, PartialEq, Deserialize, Serialize, ToSchema)]
pub struct CageJobList {
    /// The designs.
    pub cages: Vec<CageJob>,
    /// Give it as `after` to get the next page; null on the last.
    pub next: Option<String>,
}

/// Progress of a design, the data of a server-sent event.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize, ToSchema)]
pub struct CageProgress {
    /// What it is doing.
    pub state: CageState,
    /// What is being done, in a few words.
    pub stage: Option<String>,
    /// How much of the work is done, from 0 to 1.
    #[schema(minimum = 0, maximum = 1)]
    pub fraction: f64,
    /// Vertices of the best cage so far; null before the first.
    pub vertices: Option<u32>,
    /// Mean L2 error of the best cage so far, on the frames that it is chosen by.
    pub error: Option<f64>,
}
