//! The JSON bodies of transfers: what is asked for at `POST /v1/transfers`, and what becomes of it.

use crate::messages::{JobState, Problem};
use crate::options::options;
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

options! {
    /// The JSON part `options` of `POST /v1/transfers`. What is left out has its default.
    pub coded struct TransferOptions {
        /// A name for people, at most 200 characters.
        #[schema(max_length = 200)]
        name: Option<String>,
        /// Completed session whose motion is moved, in place of files of the source.
        source_session: Option<String>,
        /// Number of frames, where the part `source_frames` is raw numbers.
        #[schema(minimum = 1)]
        frames: Option<u32>,
        /// How the motion is moved.
        method: Option<TransferMethod>,
        /// The cage around both, with `public` and `rigid`; `sphere` by default.
        public: Option<PublicShape>,
        /// Coordinates in that cage: `mvc` (the default), `harmonic`, `green` or `green-free`.
        #[schema(pattern = "^(mvc|harmonic|green|green-free)$")]
        coordinates: Option<String>,
        /// Weight of the target's rigidity, with `rigid`; 0.01 where it is left out.
        #[schema(minimum = 0)]
        rigidity: Option<f64>,
        /// Bring back the detail that a cage around both loses, with `public` and `rigid`.
        detail: bool,
        /// Which pose the target has at rest.
        pose: Option<RestPose>,
        /// How the source is laid onto the target at first.
        align: Option<SourceAlignment>,
        /// The matrix that moves the source onto the target, row by row, in place of `align`.
        matrix: Option<[f64; 16]>,
        /// Axis that points up in both: the source is turned about it alone, and feet do not slide.
        up: Option<UpAxis>,
        /// Most vertices of the target's cage, designed from its new motion; 350 by default.
        #[schema(minimum = 4, maximum = 1500)]
        cage_vertices: Option<u32>,
        /// Frames per second, written into the container; by default those of the source.
        #[schema(exclusive_minimum = 0)]
        frame_rate: Option<f64>,
        /// Number of the first frame in the container; what the source tells where it is left out.
        #[schema(exclusive_minimum = -1e9, exclusive_maximum = 1e9)]
        start: Option<f64>,
    }
}

/// How a motion is moved.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, Serialize, ToSchema)]
#[serde(rename_all = "lowercase")]
pub enum TransferMethod {
    /// By the source's cage, which is laid onto the target.
    #[default]
    Fitted,
    /// By one cage around both, as the paper has it.
    Public,
    /// The same with the target as rigid as it can be.
    Rigid,
}

/// A cage around source and target.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, Serialize, ToSchema)]
#[serde(rename_all = "lowercase")]
pub enum PublicShape {
    /// 8 vertices.
    Box,
    /// 12 vertices.
    Ico,
    /// 162 vertices.
    Sphere,
    /// The convex hull, 42 vertices.
    Hull,
    /// An offset surface, 350 vertices.
    Offset,
}

/// Which pose the target has at rest.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, Serialize, ToSchema)]
#[serde(rename_all = "lowercase")]
pub enum RestPose {
    /// Told by how alike the shapes are.
    #[default]
    Auto,
    /// Its own: what the source does to its rest pose, the target does to its own.
    Relative,
    /// The source's: limbs take its directions, for like bodies that stand differently at rest.
    Absolute,
}

/// How the source is laid onto the target at first.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, Serialize, ToSchema)]
#[serde(rename_all = "lowercase")]
pub enum SourceAlignment {
    /// By their surfaces.
    #[default]
    Pca,
    /// As they stand.
    None,
}

/// An axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, Serialize, ToSchema)]
#[serde(rename_all = "lowercase")]
pub enum UpAxis {
    /// The first.
    X,
    /// The second.
    Y,
    /// The third.
    Z,
}

/// What a running transfer is at.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, Serialize, ToSchema)]
#[serde(rename_all = "lowercase")]
pub enum TransferStage {
    /// The source is laid onto the target.
    Preparing,
    /// Frames are being moved.
    Moving,
    /// The target's cage is being designed.
    Designing,
    /// The container is being written.
    Encoding,
}

/// A transfer.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize, ToSchema)]
pub struct Transfer {
    /// Identifier, part of every address below it.
    pub id: String,
    /// Name given at creation.
    pub name: Option<String>,
    /// What it is doing.
    pub state: JobState,
    /// What it is at, while it runs.
    pub stage: Option<TransferStage>,
    /// Creation time, seconds since 1970.
    pub created: f64,
    /// Points of the target.
    pub points: u32,
    /// Frames of the source.
    pub frames: u32,
    /// Frames that are moved.
    pub moved: u32,
    /// What is subtracted from streamed positions, where the target lies far from the origin.
    pub origin: Option<[f64; 3]>,
    /// Vertices of the target's cage, once it is completed.
    pub cage_vertices: Option<u32>,
    /// Bytes of the container, once it is there.
    pub container_bytes: Option<u64>,
    /// What a user should know but that did not stop the work.
    pub warnings: Vec<String>,
    /// Why it failed.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub problem: Option<Problem>,
}

/// A page of transfers, newest first.
#[derive(Clone, Debug, Default, PartialEq, Deserialize, Serialize, ToSchema)]
pub struct TransferList {
    /// The transfers.
    pub transfers: Vec<Transfer>,
    /// Give it as `after` to get the next page; null on the last.
    pub next: Option<String>,
}

/// Progress of a transfer, the data of a server-sent event.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, Serialize, ToSchema)]
pub struct TransferProgress {
    /// What it is doing.
    pub state: JobState,
    /// What it is at, while it runs.
    pub stage: Option<TransferStage>,
    /// Frames of the source.
    pub frames: u32,
    /// Frames that are moved.
    pub moved: u32,
}
