//! The JSON bodies of recoveries: what `POST /v1/recoveries` asks for, and what becomes of it.

use crate::messages::Problem;
use crate::options::options;
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

options! {
    /// The JSON part `options` of `POST /v1/recoveries`. What is left out has its default.
    pub coded struct RecoveryOptions {
        /// A name for people, at most 200 characters.
        #[schema(max_length = 200)]
        name: Option<String>,
        /// `auto`: turn and move the template onto the first surface before it is followed.
        align: Option<Placing>,
        /// `auto`: scale the template to the first surface, and turn and move it as with `align`.
        scale: Option<Placing>,
        /// Axis that points up in the frames, where the other one does in the template: `y` or `z`.
        #[schema(pattern = "^[yz]$")]
        up: Option<String>,
        /// Let points of the template leave the cage to meet the surfaces; needs an error.
        offsets: bool,
        /// Go on past frames without a surface, and where the template seems turned.
        force: bool,
        /// Points of each surface that are looked at; 15,000 where it is left out.
        #[schema(minimum = 100, maximum = 1000000)]
        points: Option<u32>,
        /// How a person is followed, with a rig: `robust` (the default) or `paper`.
        #[schema(pattern = "^(robust|paper)$")]
        method: Option<String>,
        /// Frames per second, written into the container and the joints.
        #[schema(exclusive_minimum = 0)]
        frame_rate: Option<f64>,
        /// Number of the first frame in the container; by default from the names of the files.
        #[schema(exclusive_minimum = -1e9, exclusive_maximum = 1e9)]
        start: Option<f64>,
        /// Number of frames, where it is known: higher ones are then refused.
        #[schema(minimum = 1)]
        frames: Option<u32>,
    }
}

/// Whether something is found automatically.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, Serialize, ToSchema)]
#[serde(rename_all = "lowercase")]
pub enum Placing {
    /// As it is.
    #[default]
    None,
    /// By the first surface.
    Auto,
}

/// What a recovery is doing.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, Serialize, ToSchema)]
#[serde(rename_all = "lowercase")]
pub enum RecoveryState {
    /// All frames that came are followed; it waits for more.
    Ready,
    /// Frames are being followed, or wait for their turn.
    Following,
    /// No more frames are coming: the last are followed, and the container is written.
    Finishing,
    /// The container is there; nothing changes any more.
    Completed,
    /// There is no container; `problem` says why.
    Failed,
}

impl RecoveryState {
    /// Whether nothing changes any more.
    pub fn is_final(self) -> bool {
        matches!(self, Self::Completed | Self::Failed)
    }
}

/// How far the frames of a recovery are.
#[derive(Clone, Debug, Default, PartialEq, Deserialize, Serialize, ToSchema)]
pub struct RecoveryFrames {
    /// Frames that are on disk.
    pub received: u32,
    /// Frames that were followed, from the first on.
    pub followed: u32,
    /// Frames that the last pass is done with.
    pub refined: u32,
    /// Frames followed in which part of the template may be somewhere else.
    pub lost: u32,
    /// Number of frames in all, once it was said.
    pub declared: Option<u32>,
    /// Ranges `[a, b)` that are missing below the highest frame; the first ones.
    pub missing: Vec<[u32; 2]>,
}

/// A recovery.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize, ToSchema)]
pub struct Recovery {
    /// Identifier, part of every address below it.
    pub id: String,
    /// Name given at creation.
    pub name: Option<String>,
    /// What it is doing.
    pub state: RecoveryState,
    /// Creation time, seconds since 1970.
    pub created: f64,
    /// Points of the template.
    pub points: u32,
    /// Vertices of its cage; null until it is made.
    pub cage_vertices: Option<u32>,
    /// What is subtracted from the positions of cages, where the template lies far from the origin.
    pub origin: Option<[f64; 3]>,
    /// Whether a person is followed by a rig, so that there are joints.
    pub joints: bool,
    /// How far the frames are.
    pub frames: RecoveryFrames,
    /// Bytes of the container, once it is there.
    pub container_bytes: Option<u64>,
    /// What a user should know but that did not stop the work.
    pub warnings: Vec<String>,
    /// Why it failed.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub problem: Option<Problem>,
}

/// No more frames are coming.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, Serialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct CompleteRecovery {
    /// How many there are, counted from 0 without a gap: all that were posted.
    #[schema(minimum = 1)]
    pub frames: u32,
}

/// A page of recoveries, newest first.
#[derive(Clone, Debug, Default, PartialEq, Deserialize, Serialize, ToSchema)]
pub struct RecoveryList {
    /// The recoveries.
    pub recoveries: Vec<Recovery>,
    /// Give it as `after` to get the next page; null on the last.
    pub next: Option<String>,
}

/// A frame that is on disk.
#[derive(Clone, Debug, PartialEq, Eq, Deserialize, Serialize, ToSchema)]
pub struct PostedFrame {
    /// Its number.
    pub frame: u32,
    /// Name of its file.
    pub file: String,
    /// Bytes of its file.
    pub bytes: u64,
}

/// Frames of a request, all on disk.
#[derive(Clone, Debug, Default, PartialEq, Eq, Deserialize, Serialize, ToSchema)]
pub struct PostedFrames {
    /// The frames, in their order.
    pub frames: Vec<PostedFrame>,
    /// Frames of the recovery that are on disk.
    pub received: u32,
}

/// How a frame was found in the first pass.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize, ToSchema)]
pub struct FollowedFrame {
    /// Its number.
    pub frame: u32,
    /// How well the template lies on the surface, a fraction of its size; null without a surface.
    pub score: Option<f64>,
    /// Where the joints of a person are, in the order of `joints.csv`; none of any other subject.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub joints: Vec<[f64; 3]>,
    /// `followed` from the frame before, by a `wider_search`, `lost`, or `no_surface`.
    pub outcome: String,
}

/// Progress of a recovery, the data of a server-sent event.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize, ToSchema)]
pub struct RecoveryProgress {
    /// What it is doing.
    pub state: RecoveryState,
    /// Frames that are on disk.
    pub received: u32,
    /// Frames that were followed, from the first on.
    pub followed: u32,
    /// Frames that the last pass is done with.
    pub refined: u32,
    /// Frames that were followed since the event before; a thousand at most.
    pub frames: Vec<FollowedFrame>,
}
