//! `GET /v1/sessions/{id}/cages`: solved cages, as a download or as a live stream.

use super::extract::{Accept, Query, RequestedSession};
use super::openapi;
use super::ranged::Immutable;
use super::solved_frames::records_of;
use super::waiting::{not_acceptable, prepared};
use crate::admission::Permit;
use crate::problem::{self, ApiError};
use crate::service::Service;
use crate::session::frames::RANGES;
use crate::session::{Phase, Session, gone};
use axum::body::Body;
use axum::extract::State;
use axum::response::{IntoResponse, Response};
use bytes::Bytes;
use cager_proto::record;
use http::{HeaderMap, header};
use serde::Deserialize;
use std::io;
use std::ops::Range;
use std::sync::Arc;

/// Frames read and sent at a time.
const PIECE_FRAMES: usize = 64;

/// Which cages.
#[derive(Debug, Deserialize, utoipa::IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub(crate) struct CagesQuery {
    /// First frame.
    #[serde(default)]
    first: u32,
    /// Number of frames; all that follow without a gap where it is left out.
    count: Option<u32>,
    /// Keep the stream open for frames still to come, in order, until the session is completed.
    #[serde(default)]
    follow: bool,
}

/// Encoding of the response body.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Form {
    Raw,
    Records,
}

impl Form {
    fn media_type(self) -> &'static str {
        match self {
            Self::Raw => "application/octet-stream",
            Self::Records => record::MEDIA_TYPE,
        }
    }

    fn stride(self, unknowns: u32) -> u64 {
        12 * u64::from(unknowns) + if self == Self::Records { record::HEADER_BYTES as u64 } else { 0 }
    }

    /// Encoded cages of consecutive frames from `first` on, at most `most`, up to the first gap. Blocks.
    fn read(self, session: &Session, first: u32, most: usize) -> io::Result<Bytes> {
        let entries = session.frames().run(first, most);
        if self == Self::Records {
            return records_of(session, &entries);
        }
        let mut out = Vec::new();
        session.read_cages(&entries, &mut out)?;
        Ok(out.into())
    }
}

/// Solved cages: m × 3 little-endian f32 each, or frame records. With `follow` the stream stays open until the session is completed, and breaks off, without a
/// last chunk, where that is deleted or fails. Cages of a completed session never change: they have an `ETag` and take `Range`.
#[utoipa::path(
    get, path = "/v1/sessions/{id}/cages", operation_id = "get_cages", tag = "results", params(openapi::Id, CagesQuery, openapi::Conditions),
    responses(
        (status = 200, description = "The cages", content(
            (Vec<u8> = "application/octet-stream"), (Vec<u8> = "application/vnd.cager.frames"),
        )),
        (status = 206, description = "The range asked for", content(
            (Vec<u8> = "application/octet-stream"), (Vec<u8> = "application/vnd.cager.frames"),
        )),
        (status = 304, description = "The client's copy is current"),
    ),
)]
pub(crate) async fn get(
    State(service): State<Arc<Service>>,
    RequestedSession { session, tenant }: RequestedSession,
    Query(query): Query<CagesQuery>,
    accept: Accept,
    headers: HeaderMap,
) -> Result<Response, ApiError> {
    let form = match accept {
        Accept::Records => Form::Records,
        Accept::Anything | Accept::Binary => Form::Raw,
        _ => return Err(not_acceptable("application/octet-stream or application/vnd.cager.frames")),
    };
    let facts = prepared(&service, &session).await?;
    if query.follow {
        let place = service.stream(&tenant)?;
        let last = query.count.map_or(u64::MAX, |count| u64::from(query.first) + u64::from(count));
        let stream = follow(service, session, form, u64::from(query.first), last, place);
        let response_headers = [(header::CONTENT_TYPE, form.media_type()), (header::CACHE_CONTROL, "no-store")];
        return Ok((response_headers, Body::from_stream(stream)).into_response());
    }
    let declared = session.declared();
    let there = {
        let there = session.frames().run_length(query.first);
        declared.map_or(there, |frames| there.min(u64::from(frames.saturating_sub(query.first))))
    };
    let count = query.count.map_or(there, u64::from);
    if count > there {
        let end = (u64::from(query.first) + count).min(u64::from(u32::MAX)) as u32;
        let missing = session.frames().missing(query.first, Some(end), RANGES).ranges;
        let detail = format!(
            "{there} of the {count} frames from {} on are solved; request fewer, or use follow=true",
            query.first
        );
        return Err(ApiError::new(problem::FRAMES_MISSING, detail).missing(missing));
    }
    let stride = form.stride(facts.unknowns);
    let first = query.first;
    let reading = Arc::clone(&session);
    let read = move |range: Range<u64>| read_range(&reading, form, first, stride, range);
    let digest = match session.status().phase {
        Phase::Completed(completion) => Some(completion.container_digest),
        _ => None,
    };
    let kind = if form == Form::Records { "r" } else { "c" };
    let cages = Immutable {
        length: stride * count,
        etag: format!("{}-{kind}{first}-{count}", digest.as_deref().unwrap_or("live")),
        media_type: form.media_type(),
        public: !service.access.is_guarded(),
        room: Permit::empty(&service.download_memory, &tenant.name),
        read: Arc::new(read),
    };
    if digest.is_some() {
        return Ok(cages.respond_readable(&headers).await);
    }
    // More frames may follow, so the response is not cacheable.
    let mut response = cages.respond_readable(&HeaderMap::new()).await;
    for name in [header::ETAG, header::ACCEPT_RANGES, header::CACHE_CONTROL] {
        response.headers_mut().remove(name);
    }
    response.headers_mut().insert(header::CACHE_CONTROL, http::HeaderValue::from_static("no-store"));
    Ok(response)
}

/// A byte range of the encoded cages from frame `first` on, `stride` bytes each. Blocks.
fn read_range(session: &Session, form: Form, first: u32, stride: u64, range: Range<u64>) -> io::Result<Bytes> {
    let (begin, end) = (range.start / stride, range.end.div_ceil(stride));
    let frames = form.read(session, first + begin as u32, (end - begin) as usize)?;
    let from = (range.start - begin * stride) as usize;
    let to = from + (range.end - range.start) as usize;
    if frames.len() < to {
        return Err(io::Error::other("a frame was removed during the download"));
    }
    Ok(frames.slice(from..to))
}

fn follow(
    service: Arc<Service>,
    session: Arc<Session>,
    form: Form,
    first: u64,
    last: u64,
    place: Permit,
) -> impl futures_util::Stream<Item = io::Result<Bytes>> {
    let changes = session.changes();
    futures_util::stream::unfold((first, changes, place), move |(next, mut changes, place)| {
        let (service, session) = (Arc::clone(&service), Arc::clone(&session));
        async move {
            loop {
                changes.mark_unchanged();
                // Read before the frames, so that no frame is missed.
                let phase = session.status().phase;
                let end = match &phase {
                    Phase::Completed(completion) => last.min(u64::from(completion.frames)),
                    _ => last,
                };
                if next >= end {
                    return None;
                }
                let most = PIECE_FRAMES.min((end - next) as usize);
                let reading = Arc::clone(&session);
                let read = tokio::task::spawn_blocking(move || form.read(&reading, next as u32, most)).await;
                let bytes = match read.map_err(io::Error::other).and_then(|bytes| bytes) {
                    Ok(bytes) => bytes,
                    Err(error) => {
                        let error = if session.is_going() { gone().into() } else { error };
                        return Some((Err(error), (u64::MAX, changes, place)));
                    }
                };
                if !bytes.is_empty() {
                    let stride = form.stride(session.facts().map_or(1, |facts| facts.unknowns));
                    let sent = bytes.len() as u64 / stride;
                    return Some((Ok(bytes), (next + sent, changes, place)));
                }
                if matches!(phase, Phase::Failed(_)) {
                    let error = io::Error::other("the session failed");
                    return Some((Err(error), (u64::MAX, changes, place)));
                }
                tokio::select! {
                    _ = changes.changed() => {}
                    () = session.deleted().cancelled() => return Some((Err(gone().into()), (u64::MAX, changes, place))),
                    () = service.stopping().cancelled() => {
                        let error = io::Error::other("the service is stopping");
                        return Some((Err(error), (u64::MAX, changes, place)));
                    }
                }
            }
        }
    })
}
