//! Errors of the service as problem details (RFC 9457): one place for their kinds, titles and statuses.

use crate::store::StoreError;
use cager_proto::messages::Problem;
use http::StatusCode;

/// An error response.
#[derive(Clone, Debug, PartialEq)]
pub struct ApiError {
    /// The body.
    pub problem: Box<Problem>,
    /// Value of `Retry-After`, in seconds.
    pub retry_after: Option<u32>,
    /// The database or the bucket does not answer, or the disk is full: work that met it waits, and is not over.
    pub(crate) passes: bool,
}

/// A kind of error. Its word is part of the API.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ProblemKind {
    /// Last part of the problem's type.
    pub word: &'static str,
    /// What went wrong, the same for every error of the kind.
    pub title: &'static str,
    /// HTTP status.
    pub status: StatusCode,
}

macro_rules! kinds {
    ($($name:ident $status:ident $word:literal $title:literal;)*) => {
        $(#[doc = $title] pub const $name: ProblemKind = ProblemKind { word: $word, title: $title, status: StatusCode::$status };)*
        /// Every kind, for documents.
        pub const ALL: &[ProblemKind] = &[$($name),*];
    };
}

kinds! {
    BAD_REQUEST BAD_REQUEST "bad-request" "The request cannot be understood";
    UNAUTHORIZED UNAUTHORIZED "unauthorized" "No valid token was given";
    FORBIDDEN FORBIDDEN "forbidden" "The page, the name or the token is not allowed to do this";
    NOT_FOUND NOT_FOUND "not-found" "There is nothing at this address";
    METHOD_NOT_ALLOWED METHOD_NOT_ALLOWED "method-not-allowed" "This address does not take that method";
    NOT_ACCEPTABLE NOT_ACCEPTABLE "not-acceptable" "None of the accepted media types is available";
    REQUEST_TIMEOUT REQUEST_TIMEOUT "request-timeout" "The request stopped arriving";
    FRAME_CONFLICT CONFLICT "frame-conflict" "The frame was posted before with other content";
    FRAMES_MISSING CONFLICT "frames-missing" "Frames are missing";
    NOT_COMPLETED CONFLICT "not-completed" "The session or job is not completed yet";
    SESSION_COMPLETED CONFLICT "session-completed" "The session is completed and does not change any more";
    SESSION_FAILED CONFLICT "session-failed" "The session failed and cannot be used";
    NOT_READY CONFLICT "not-ready" "The session is still being prepared";
    CAGE_NOT_READY CONFLICT "cage-not-ready" "The cage is still being designed";
    CAGE_FAILED CONFLICT "cage-failed" "No cage could be designed";
    RECOVERY_COMPLETED CONFLICT "recovery-completed" "The recovery takes no frames any more";
    RECOVERY_FAILED CONFLICT "recovery-failed" "The recovery failed and cannot be used";
    TRANSFER_FAILED CONFLICT "transfer-failed" "The motion could not be moved";
    KEY_IN_USE CONFLICT "idempotency-key-in-use" "A request with this idempotency key is still being worked on";
    SESSION_DELETED GONE "session-deleted" "The session was deleted";
    TOO_LARGE PAYLOAD_TOO_LARGE "too-large" "The body is larger than allowed";
    MEDIA_TYPE UNSUPPORTED_MEDIA_TYPE "media-type" "The media type is not supported";
    RANGE RANGE_NOT_SATISFIABLE "range" "The range lies outside";
    INVALID_OPTIONS UNPROCESSABLE_ENTITY "invalid-options" "The options cannot be used";
    INVALID_GEOMETRY UNPROCESSABLE_ENTITY "invalid-geometry" "The rest pose and its cage cannot be used";
    INVALID_FRAME UNPROCESSABLE_ENTITY "invalid-frame" "The frame cannot be used";
    KEY_REUSED UNPROCESSABLE_ENTITY "idempotency-key-reused" "The idempotency key was used for another request";
    TOO_MANY_SESSIONS TOO_MANY_REQUESTS "too-many-sessions" "The tenant has as many sessions as it may";
    TOO_MANY_STREAMS TOO_MANY_REQUESTS "too-many-streams" "The tenant has as many streams open as it may";
    TOO_MANY_JOBS TOO_MANY_REQUESTS "too-many-jobs" "The tenant has as many jobs waiting as it may";
    SHARE_TAKEN TOO_MANY_REQUESTS "share-taken" "The tenant holds its share of what all tenants use";
    HEADER_TOO_LARGE REQUEST_HEADER_FIELDS_TOO_LARGE "header-too-large" "The header is too large";
    INTERNAL INTERNAL_SERVER_ERROR "internal" "The service failed";
    BUSY SERVICE_UNAVAILABLE "busy" "The service has too much to do";
    STOPPING SERVICE_UNAVAILABLE "stopping" "The service is stopping";
    STORAGE_FAILED SERVICE_UNAVAILABLE "storage-failed" "The service's disk cannot be read or written";
    STORAGE_FULL INSUFFICIENT_STORAGE "storage-full" "The service's disk is full";
    QUOTA_EXCEEDED INSUFFICIENT_STORAGE "quota-exceeded" "The tenant's storage quota is used up";
}

impl std::fmt::Display for ApiError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&self.problem.detail)
    }
}

impl std::error::Error for ApiError {}

impl From<ApiError> for std::io::Error {
    fn from(error: ApiError) -> Self {
        Self::other(error)
    }
}

impl ApiError {
    /// An error of this kind; `detail` says what went wrong here and what to do.
    pub fn new(kind: ProblemKind, detail: impl Into<String>) -> Self {
        let problem = Problem {
            kind: format!("{}{}", Problem::TYPE_PREFIX, kind.word),
            title: kind.title.to_owned(),
            status: kind.status.as_u16(),
            detail: detail.into(),
            ..Problem::default()
        };
        Self { problem: Box::new(problem), retry_after: None, passes: false }
    }

    /// An internal error: the cause is logged, not returned.
    pub fn internal(cause: &dyn std::fmt::Display) -> Self {
        tracing::error!(%cause, "internal error");
        Self::new(INTERNAL, "something went wrong in the service; the log of the request has more")
    }

    /// Sets `Retry-After`.
    pub fn retry_after(mut self, seconds: u32) -> Self {
        self.retry_after = Some(seconds);
        self
    }

    /// Sets the frame at fault.
    pub fn frame(mut self, frame: u32) -> Self {
        self.problem.frame = Some(frame);
        self
    }

    /// Sets the missing ranges.
    pub fn missing(mut self, missing: Vec<[u32; 2]>) -> Self {
        self.problem.missing = Some(missing);
        self
    }

    /// Sets the limit that was exceeded.
    pub fn limit(mut self, limit: u64) -> Self {
        self.problem.limit = Some(limit);
        self
    }

    /// The HTTP status.
    pub fn status(&self) -> StatusCode {
        StatusCode::from_u16(self.problem.status).unwrap_or(StatusCode::INTERNAL_SERVER_ERROR)
    }
}

/// The response for a storage error.
impl From<StoreError> for ApiError {
    fn from(error: StoreError) -> Self {
        Self::from(&error)
    }
}

impl From<&StoreError> for ApiError {
    fn from(error: &StoreError) -> Self {
        let answer = match error {
            StoreError::Full { .. } => Self::new(
                STORAGE_FULL,
                "the service's disk is full; no acknowledged frame is lost, so try again when the operator has freed space",
            )
            .retry_after(60),
            StoreError::Away { .. } => {
                tracing::warn!(%error, "the database or the bucket does not answer");
                let detail = "the service's database or bucket does not answer; no acknowledged frame is lost, so try again in a moment";
                Self::new(STORAGE_FAILED, detail).retry_after(2)
            }
            StoreError::Io { .. } | StoreError::Catalog { .. } => {
                tracing::error!(%error, "a file of the store or its catalogue cannot be read or written");
                let detail = "the service's disk or database failed to read or write; no acknowledged frame is lost, so try again when the operator has checked it";
                Self::new(STORAGE_FAILED, detail).retry_after(10)
            }
            StoreError::Damaged { .. } => {
                tracing::error!(%error, "a file of the store is damaged");
                let detail = "stored data of this session is damaged; upload the capture to a new session, or ask the operator to restore it from a backup";
                Self::new(SESSION_FAILED, detail)
            }
            other => Self::internal(other),
        };
        Self { passes: error.is_passing(), ..answer }
    }
}

impl From<Problem> for ApiError {
    fn from(problem: Problem) -> Self {
        Self { problem: Box::new(problem), retry_after: None, passes: false }
    }
}
