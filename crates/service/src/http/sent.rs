//! `GET /v1/sessions/{id}/sent`: what a session was sent, as digests.

use super::extract::{Query, RequestedSession};
use super::openapi;
use crate::problem::ApiError;
use crate::session::Session;
use crate::store::{FrameEntry, StoredPart};
use crate::tasks::blocking;
use axum::response::{IntoResponse, Response};
use cager_proto::messages::{Sent, SentFile, SentFrame};
use http::header::CONTENT_TYPE;
use serde::Deserialize;
use std::fmt::Write as _;

/// Most frames of an answer.
const PAGE_FRAMES: usize = 1 << 16;

/// Which frames.
#[derive(Debug, Deserialize, utoipa::IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub(crate) struct SentQuery {
    /// First frame.
    #[serde(default)]
    first: u32,
}

/// What the session was sent: its options, and digests of its files and frames, 65,536 frames at a time. Compare them before you go on with
/// a session from files that may have changed.
#[utoipa::path(get, path = "/v1/sessions/{id}/sent", operation_id = "get_sent", tag = "sessions", params(openapi::Id, SentQuery), responses((status = 200, description = "What was sent", body = Sent)))]
pub(crate) async fn get(
    RequestedSession { session, .. }: RequestedSession,
    Query(SentQuery { first }): Query<SentQuery>,
) -> Result<Response, ApiError> {
    session.ensure_loaded().await?;
    let sent = blocking(move || sent(&session, first)).await??;
    let body = serde_json::to_vec(&sent).map_err(|error| ApiError::internal(&error))?;
    Ok(([(CONTENT_TYPE, "application/json")], body).into_response())
}

fn sent(session: &Session, first: u32) -> Result<Sent, ApiError> {
    let [rest, cage, matrix] = session.files()?;
    let options = session.sent_options()?;
    let has_sent_cage = options.cage.is_none() && session.meta.made_cage.is_none();
    let (frames, next) = {
        let known = session.frames();
        let mut following = known.entries_from(first);
        let frames = following.by_ref().take(PAGE_FRAMES).map(frame).collect();
        (frames, following.next().map(|entry| entry.frame))
    };
    Ok(Sent {
        options,
        rest: rest.map(file).unwrap_or_default(),
        cage: cage.filter(|_| has_sent_cage).map(file),
        regularizer_matrix: matrix.map(file),
        frames,
        next,
    })
}

fn file(StoredPart { name, bytes, blake3 }: StoredPart) -> SentFile {
    SentFile { name, bytes, blake3 }
}

fn frame(entry: &FrameEntry) -> SentFrame {
    let digest = entry.full_digest.unwrap_or(entry.handle_digest);
    let mut blake3 = String::with_capacity(2 * digest.len());
    for byte in digest {
        // Writing to a string does not fail.
        let _ = write!(blake3, "{byte:02x}");
    }
    SentFrame { frame: entry.frame, handles_only: entry.full_digest.is_none(), blake3 }
}
