//! The JSON bodies of the service, shared by server and client.
//!
//! Lengths are fractions of the rest pose's bounding-box diagonal, times are seconds.

use crate::object::Object;
pub use crate::report::ConditionNumber;
use serde::{Deserialize, Serialize};

/// What a session is doing.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, Serialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(rename_all = "lowercase")]
pub enum SessionState {
    /// Coordinates, handles and operator are being computed.
    Preparing,
    /// Frames are accepted. Where there is a `problem`, the session was completed, and is to be completed again.
    Ready,
    /// All frames are there and the container is written; nothing changes any more.
    Completed,
    /// The session cannot be used; `problem` says why.
    Failed,
}

/// What a job is doing that is created as a whole.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, Serialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
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

/// Choices for a session, the JSON part `options` of its creation. What is left out has its default.
#[derive(Clone, Debug, Default, PartialEq, Deserialize, Serialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(default, deny_unknown_fields)]
pub struct SessionOptions {
    /// A name for people, at most 200 characters.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[cfg_attr(feature = "schema", schema(max_length = 200))]
    pub name: Option<String>,
    /// Coordinate system: `mvc`, `harmonic`, `green` (normals follow from the vertices) or `green-free` (normals are unknowns).
    #[serde(skip_serializing_if = "Option::is_none")]
    #[cfg_attr(feature = "schema", schema(pattern = "^(mvc|harmonic|green|green-free)$"))]
    pub coordinates: Option<String>,
    /// Points the inversion reads: `spread`, `maxvol`, `rectangular` or `all`. Where it is left out `spread`, or `all` where frames are coded
    /// (except with `green`).
    #[serde(skip_serializing_if = "Option::is_none")]
    #[cfg_attr(feature = "schema", schema(pattern = "^(maxvol|rectangular|spread|all)$"))]
    pub handles: Option<String>,
    /// How many points `rectangular` and `spread` read, from the number of unknowns to that of points; twice the unknowns where it
    /// is left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[cfg_attr(feature = "schema", schema(minimum = 1))]
    pub handle_count: Option<u32>,
    /// Treatment of the unstable end of the spectrum: `differential` (where it is left out: keeps the shape of the rest cage),
    /// `laplacian`, `temporal` (frames have to come in order), `matrix` (with a part `regularizer_matrix`), `none`, `truncated-svd`,
    /// `tikhonov` or `global`.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[cfg_attr(
        feature = "schema",
        schema(pattern = "^(laplacian|differential|temporal|matrix|none|truncated-svd|tikhonov|global)$")
    )]
    pub regularizer: Option<String>,
    /// Spectrum threshold: how many of the last singular directions are regularised; 20, or a sixteenth of the unknowns where that
    /// is less, where it is left out. Where frames are coded (except with `green`) and neither it, `lambda` nor another regularizer than `differential` is
    /// given, all are, with a `lambda` of 0.001.
    #[serde(skip_serializing_if = "Option::is_none", deserialize_with = "threshold")]
    pub spectrum: Option<u32>,
    /// Weight of the regularisation; 1 where it is left out, but see `spectrum`.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[cfg_attr(feature = "schema", schema(minimum = 0))]
    pub lambda: Option<f64>,
    /// Where the cage comes from if none is sent as a part; made from the rest pose where this is left out as well.
    #[serde(skip_serializing_if = "Option::is_none", deserialize_with = "cage_source")]
    pub cage: Option<CageSource>,
    /// Turn a cage inside out whose faces all point inwards.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub flip_cage: bool,
    /// Frames per second, written into the container.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[cfg_attr(feature = "schema", schema(exclusive_minimum = 0))]
    pub frame_rate: Option<f64>,
    /// Number of frames of the capture, where it is known: a frame with this number or a higher one is then refused at once, instead of when
    /// the session is completed.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[cfg_attr(feature = "schema", schema(minimum = 1))]
    pub frames: Option<u32>,
    /// Code the frames in groups so that no point of any frame is farther from where it was posted than this fraction of the diagonal. At
    /// most one of `max_error`, `mean_error`, `target_size` and `quality` is given; frames are then posted whole.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[cfg_attr(feature = "schema", schema(exclusive_minimum = 0, exclusive_maximum = 1))]
    pub max_error: Option<f64>,
    /// As `max_error`, but for the root mean square error of a frame's points, averaged over the frames.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[cfg_attr(feature = "schema", schema(exclusive_minimum = 0, exclusive_maximum = 1))]
    pub mean_error: Option<f64>,
    /// Most bytes of the container; `frames` is needed with it.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[cfg_attr(feature = "schema", schema(minimum = 1))]
    pub target_size: Option<u64>,
    /// `preview` (cages alone), `standard` (errors that are not seen) or `master` (as `max_error` 1e-4).
    #[serde(skip_serializing_if = "Option::is_none")]
    #[cfg_attr(feature = "schema", schema(pattern = "^(preview|standard|master)$"))]
    pub quality: Option<String>,
    /// Keep rest pose and cage exactly as they were sent, where one of these four allows less.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub exact_rest: bool,
}

/// A cage that is not sent. At most one of its fields is given.
#[derive(Clone, Debug, Default, PartialEq, Eq, Deserialize, Serialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(default, deny_unknown_fields)]
pub struct CageSource {
    /// The cage is made around the rest pose, with at most so many vertices; 350 where it is left out, or half as many as the model has
    /// points.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[cfg_attr(feature = "schema", schema(minimum = 4, maximum = 20000))]
    pub vertices: Option<u32>,
    /// The cage is that of this completed design, see `POST /v1/cages`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub id: Option<String>,
}

fn cage_source<'de, D: serde::Deserializer<'de>>(deserializer: D) -> Result<Option<CageSource>, D::Error> {
    Ok(Option::<Object<CageSource>>::deserialize(deserializer)?.map(|Object(source)| source))
}

/// A threshold; the command line's `auto` needs frames to measure.
fn threshold<'de, D: serde::Deserializer<'de>>(deserializer: D) -> Result<Option<u32>, D::Error> {
    struct Threshold;

    impl<'de> serde::de::Visitor<'de> for Threshold {
        type Value = Option<u32>;

        fn expecting(&self, out: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
            out.write_str("a number of singular directions as spectrum")
        }

        fn visit_u64<E: serde::de::Error>(self, value: u64) -> Result<Self::Value, E> {
            u32::try_from(value).map(Some).map_err(|_| E::invalid_value(serde::de::Unexpected::Unsigned(value), &self))
        }

        fn visit_str<E: serde::de::Error>(self, value: &str) -> Result<Self::Value, E> {
            if value == "auto" {
                let text = "spectrum auto is chosen by frames, and a service prepares before it sees any; give a number, or encode with the command line, without --server";
                return Err(E::custom(text));
            }
            Err(E::invalid_value(serde::de::Unexpected::Str(value), &self))
        }

        fn visit_unit<E: serde::de::Error>(self) -> Result<Self::Value, E> {
            Ok(None)
        }
    }

    deserializer.deserialize_any(Threshold)
}

/// A session. Numbers that preparing finds are null until it is done.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
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
    /// How far the coding of the frames is; only where the session was made with `max_error`, `mean_error`, `target_size` or `quality`.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub coding: Option<CodedFrames>,
    /// Whether the prepared solver was there already.
    pub cache: Option<CacheUse>,
    /// Times of the preparation.
    pub seconds: PreparationSeconds,
    /// What a user should know but that did not stop the work.
    pub warnings: Vec<String>,
    /// Why the session failed. While it is `ready`: its container is damaged, and is written again when the session is completed again.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub problem: Option<Problem>,
}

/// A cage in its rest pose.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct RestCage {
    /// Its vertices.
    pub vertices: Vec<[f64; 3]>,
    /// Its triangles, counter-clockwise seen from outside.
    pub faces: Vec<[u32; 3]>,
}

/// Where the solver of a session came from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, Serialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(rename_all = "lowercase")]
pub enum CacheUse {
    /// An earlier session of the same tenant had prepared it.
    Hit,
    /// It was prepared for this session.
    Miss,
}

/// Progress of a session's frames.
#[derive(Clone, Debug, Default, PartialEq, Deserialize, Serialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct FrameCounts {
    /// Frames that arrived whole, solved or waiting.
    pub received: u64,
    /// Frames that are solved and on disk.
    pub solved: u64,
    /// Ranges `[a, b)` that are not solved, below the highest frame, or below the number declared at completion; the first ones, where
    /// there are many.
    pub missing: Vec<[u32; 2]>,
    /// Where the ranges that follow begin, if `missing` has not all of them.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub missing_next: Option<u32>,
}

/// Frames of a session that are coded in groups.
#[derive(Clone, Debug, Default, PartialEq, Deserialize, Serialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
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
#[derive(Clone, Copy, Debug, Default, PartialEq, Deserialize, Serialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
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
#[derive(Clone, Debug, Default, PartialEq, Deserialize, Serialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct SessionList {
    /// The sessions.
    pub sessions: Vec<Session>,
    /// Give it as `after` to get the next page; null on the last.
    pub next: Option<String>,
}

/// A solved frame: one line of the answer to posted frames.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct FrameResult {
    /// Number of the frame, from 0.
    pub frame: u32,
    /// `sqrt(mean |e|²)`; null where only the handle rows were sent.
    pub l2: Option<f32>,
    /// `max |e|`; null where only the handle rows were sent.
    pub linf: Option<f32>,
}

/// Errors of all solved frames, ascending.
#[derive(Clone, Debug, Default, PartialEq, Deserialize, Serialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct FrameErrors {
    /// The frames.
    pub frames: Vec<FrameResult>,
}

/// What a session was sent, so that who goes on with it can tell whether it is of the same capture.
#[derive(Clone, Debug, Default, PartialEq, Deserialize, Serialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
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
#[derive(Clone, Debug, Default, PartialEq, Eq, Deserialize, Serialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct SentFile {
    /// Its name.
    pub name: String,
    /// Its length.
    pub bytes: u64,
    /// Its digest, BLAKE3, hexadecimal.
    pub blake3: String,
}

/// A frame that was sent.
#[derive(Clone, Debug, Default, PartialEq, Eq, Deserialize, Serialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct SentFrame {
    /// Its number.
    pub frame: u32,
    /// Whether only its handle rows came.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub handles_only: bool,
    /// First half of the BLAKE3 digest of its rows as little-endian f32, hexadecimal: of all points, or of the handles in their order.
    pub blake3: String,
}

/// Gives a session another name.
#[derive(Clone, Debug, Default, PartialEq, Eq, Deserialize, Serialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct Rename {
    /// Its name from now on, at most 200 characters; empty for none.
    pub name: String,
}

/// Says that no more frames are coming.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, Serialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct Complete {
    /// Number of frames of the capture, at least 1.
    #[cfg_attr(feature = "schema", schema(minimum = 1))]
    pub frames: u32,
    /// Leave out frames with this number and above, which were posted by mistake. Without it, such frames are an error.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub discard_beyond: bool,
}

/// Progress, the data of a server-sent event.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
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
#[derive(Clone, Debug, Default, PartialEq, Deserialize, Serialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
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
