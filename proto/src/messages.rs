//! The JSON bodies of the service, shared by server and client.
//!
//! Lengths are fractions of the rest pose's bounding-box diagonal, times are seconds.

pub use crate::report::ConditionNumber;
pub use crate::session_options::{CageSource, SessionOptions};
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// What a session is doing.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, Serialize, ToSchema)]
#[serde(rename_all = "lowercase")]
pub enum SessionState {
    /// Coordinates, handles and operator are being computed.
    Preparing,
    /// Frames are accepted. With a `problem`, the session is to be completed again.
    Ready,
    /// All frames are there and the container is written; nothing changes any more.
    Completed,
    /// The session cannot be used; `problem` says why.
    Failed,
}

/// What a job is doing that is created as a whole.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, Serialize, ToSchema)]
#[serde(rename_all = "lowercase")]
pub enum JobState {
    /// It waits for its turn.
    Queued,
    /// It is being worked on.
    Running,
    /// The result is there; nothing changes any more.
    Completed,
    /// There is no result; `problem` says why.
    Failed,
}

impl JobState {
    /// Whether nothing changes any more.
    pub fn is_final(self) -> bool {
        matches!(self, Self::Completed | Self::Failed)
    }
}

/// A session. Numbers that preparing finds are null until it is done.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize, ToSchema)]
pub struct Session {
    /// Identifier, part of every address below it.
    pub id: String,
    /// Name given at creation.
    pub name: Option<String>,
    /// What it is doing.
    pub state: SessionState,
    /// Creation time, seconds since 1970.
    pub created: f64,
    /// Points of the model, n.
    pub points: Option<u32>,
    /// Unknowns per frame, m: rows of a cage record.
    pub unknowns: Option<u32>,
    /// Number of handles K: rows of a frame with `rows=handles`.
    pub handle_count: Option<u32>,
    /// Vertices of the cage.
    pub cage_vertices: Option<u32>,
    /// Triangles of the cage.
    pub cage_faces: Option<u32>,
    /// Coordinate system.
    pub coordinates: String,
    /// Points the inversion reads.
    pub handles: String,
    /// Treatment of the unstable end of the spectrum.
    pub regularizer: String,
    /// Spectrum threshold; null until it is known where none was given.
    pub spectrum: Option<u32>,
    /// Weight of the regularisation.
    pub lambda: f64,
    /// Condition numbers over the numerical rank.
    pub condition_number: Option<ConditionNumber>,
    /// Numerical rank of the coordinates.
    pub rank: Option<u32>,
    /// Largest distance of `Φ C_R` from the rest pose.
    pub affine_reproduction_error: Option<f64>,
    /// How far the frames are.
    pub frames: FrameCounts,
    /// How far the coding of the frames is, if they are coded.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub coding: Option<CodedFrames>,
    /// Whether the prepared solver was there already.
    pub cache: Option<CacheUse>,
    /// Times of the preparation.
    pub seconds: PreparationSeconds,
    /// What a user should know but that did not stop the work.
    pub warnings: Vec<String>,
    /// Why the session failed or, while `ready`, is to be completed again.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub problem: Option<Problem>,
}

/// A cage in its rest pose.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize, ToSchema)]
pub struct RestCage {
    /// Its vertices.
    pub vertices: Vec<[f64; 3]>,
    /// Its triangles, counter-clockwise seen from outside.
    pub faces: Vec<[u32; 3]>,
}

/// Where the solver of a session came from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, Serialize, ToSchema)]
#[serde(rename_all = "lowercase")]
pub enum CacheUse {
    /// An earlier session of the same tenant had prepared it.
    Hit,
    /// It was prepared for this session.
    Miss,
}

/// Progress of a session's frames.
#[derive(Clone, Debug, Default, PartialEq, Deserialize, Serialize, ToSchema)]
pub struct FrameCounts {
    /// Frames that arrived whole, solved or waiting.
    pub received: u64,
    /// Frames that are solved and on disk.
    pub solved: u64,
    /// Ranges `[a, b)` that are not solved, below the highest or declared frame; the first ones.
    pub missing: Vec<[u32; 2]>,
    /// Where the ranges that follow begin, if `missing` has not all of them.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub missing_next: Option<u32>,
}

/// Frames of a session that are coded in groups.
#[derive(Clone, Debug, Default, PartialEq, Deserialize, Serialize, ToSchema)]
pub struct CodedFrames {
    /// Most frames of a group; null until the session is prepared.
    pub group_frames: Option<u32>,
    /// Frames in groups that are coded, from frame 0 on.
    pub frames: u32,
    /// Bytes of these groups.
    pub bytes: u64,
    /// Why the next group cannot be coded as asked for; completing answers the same.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub problem: Option<Problem>,
}

/// Times of a preparation; all zero where the solver was there already.
#[derive(Clone, Copy, Debug, Default, PartialEq, Deserialize, Serialize, ToSchema)]
#[serde(default)]
pub struct PreparationSeconds {
    /// Waiting for a free place.
    pub queued: f64,
    /// Reading rest pose and cage.
    pub read: f64,
    /// Computing `Φ`.
    pub coordinates: f64,
    /// Choosing the handles.
    pub maxvol: f64,
    /// Spectrum, regularisation and operator.
    pub svd: f64,
    /// From creation to readiness.
    pub total: f64,
}

/// A page of sessions, newest first.
#[derive(Clone, Debug, Default, PartialEq, Deserialize, Serialize, ToSchema)]
pub struct SessionList {
    /// The sessions.
    pub sessions: Vec<Session>,
    /// Give it as `after` to get the next page; null on the last.
    pub next: Option<String>,
}

/// A solved frame: one line of the answer to posted frames.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize, ToSchema)]
pub struct FrameResult {
    /// Number of the frame, from 0.
    pub frame: u32,
    /// `sqrt(mean |e|²)`; null where only the handle rows were sent.
    pub l2: Option<f32>,
    /// `max |e|`; null where only the handle rows were sent.
    pub linf: Option<f32>,
}

/// Errors of all solved frames, ascending.
#[derive(Clone, Debug, Default, PartialEq, Deserialize, Serialize, ToSchema)]
pub struct FrameErrors {
    /// The frames.
    pub frames: Vec<FrameResult>,
}

/// What a session was sent, so that who goes on with it can tell whether it is of the same capture.
#[derive(Clone, Debug, Default, PartialEq, Deserialize, Serialize, ToSchema)]
pub struct Sent {
    /// The options.
    pub options: SessionOptions,
    /// The rest pose.
    pub rest: SentFile,
    /// The cage; null where none was sent.
    pub cage: Option<SentFile>,
    /// The matrix of the regularizer `matrix`; null where none was sent.
    pub regularizer_matrix: Option<SentFile>,
    /// Frames that are solved, ascending: those that were asked for.
    pub frames: Vec<SentFrame>,
    /// Give it as `first` to get the frames that follow; null where these are all.
    pub next: Option<u32>,
}

/// A file that was sent.
#[derive(Clone, Debug, Default, PartialEq, Eq, Deserialize, Serialize, ToSchema)]
pub struct SentFile {
    /// Its name.
    pub name: String,
    /// Its length.
    pub bytes: u64,
    /// Its digest, BLAKE3, hexadecimal.
    pub blake3: String,
}

/// A frame that was sent.
#[derive(Clone, Debug, Default, PartialEq, Eq, Deserialize, Serialize, ToSchema)]
pub struct SentFrame {
    /// Its number.
    pub frame: u32,
    /// Whether only its handle rows came.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub handles_only: bool,
    /// First half of the BLAKE3 digest of its rows as little-endian f32, hexadecimal.
    pub blake3: String,
}

/// Gives a session another name.
#[derive(Clone, Debug, Default, PartialEq, Eq, Deserialize, Serialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct Rename {
    /// Its name from now on, at most 200 characters; empty for none.
    pub name: String,
}

/// Says that no more frames are coming.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, Serialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct Complete {
    /// Number of frames of the capture, at least 1.
    #[schema(minimum = 1)]
    pub frames: u32,
    /// Leave out frames with this number and above; without it, such frames are an error.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub discard_beyond: bool,
}

/// Progress, the data of a server-sent event.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize, ToSchema)]
pub struct Progress {
    /// What the session is doing.
    pub state: SessionState,
    /// Frames that arrived whole.
    pub received: u64,
    /// Frames that are solved and on disk.
    pub solved: u64,
    /// Frames in groups that are coded, where the session's frames are.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub coded: Option<u32>,
}

/// An error as problem details (RFC 9457), `application/problem+json`.
#[derive(Clone, Debug, Default, PartialEq, Deserialize, Serialize, ToSchema)]
pub struct Problem {
    /// Stable name of the kind of error: `urn:cager:problem:` and a word.
    #[serde(rename = "type")]
    pub kind: String,
    /// What went wrong, the same for every error of the kind.
    pub title: String,
    /// HTTP status.
    pub status: u16,
    /// What went wrong here and what to do.
    pub detail: String,
    /// Identifier of the request, also in the server's log.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub request_id: Option<String>,
    /// The frame concerned.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub frame: Option<u32>,
    /// Ranges `[a, b)` of frames that are missing.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub missing: Option<Vec<[u32; 2]>>,
    /// The limit that was passed, in bytes or in number.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub limit: Option<u64>,
}

impl Problem {
    /// What every problem type begins with.
    pub const TYPE_PREFIX: &'static str = "urn:cager:problem:";

    /// The last word of the type.
    pub fn word(&self) -> &str {
        self.kind.strip_prefix(Self::TYPE_PREFIX).unwrap_or(&self.kind)
    }
}
