//! `POST /v1/sessions/{id}/frames`: frames in, records out, while the upload runs where that is asked for.

use super::extract::{Accept, Found, Query, content_type};
use super::frames_in::{FrameReader, Layout};
use super::openapi;
use crate::admission::Held;
use crate::auth::Tenant;
use crate::problem::{self, ApiError};
use crate::service::Service;
use crate::session::facts::Facts;
use crate::session::upload::{FrameJob, Permits, Rows, Step, Upload};
use crate::session::{LiveLane, Phase, Session, gone};
use crate::store::LogEntry;
use crate::telemetry::RequestId;
use axum::Extension;
use axum::body::Body;
use axum::extract::State;
use axum::response::{IntoResponse, Response};
use bytes::Bytes;
use cager_proto::messages::FrameResult;
use cager_proto::record::{self, FrameHeader, Kind};
use http::{HeaderMap, header};
use http_body_util::BodyExt;
use serde::Deserialize;
use std::io;
use std::sync::Arc;
use std::time::Duration;
use tokio::sync::Semaphore;
use tokio::time::{Instant, sleep_until};

/// Frames of one upload that wait or are solved at a time: enough that the pool never waits for it.
const IN_FLIGHT: usize = 64;
/// Frames after which the tenant's quota is looked at again: a body need not say how long it is.
const QUOTA_EVERY: u64 = 64;
/// Frames of one upload that are not on disk yet: enough that a slow sync holds nothing up, and a bound where the disk hangs.
const NOT_WRITTEN: usize = 512;
/// Answers sent at a time.
const ANSWERS: usize = 64;
/// How long the answer's header waits for the first record: some clients give up on a server that says nothing.
const HEAD_WITHIN: Duration = Duration::from_secs(5);
/// How much of a refused body is thrown away, and for how long.
const DRAINED_BYTES: usize = 64 << 20;
const DRAINED_WITHIN: Duration = Duration::from_secs(5);
/// How long a frame waits for memory.
const ROOM_WITHIN: Duration = Duration::from_secs(30);
/// A frame keeps its memory from its first byte on, so that it has to come faster than this, after the pause that any body may
/// make.
pub(crate) const SLOWEST_BYTES_PER_SECOND: u64 = 16 << 10;
/// How long an upload waits for its session to be prepared.
const PREPARED_WITHIN: Duration = Duration::from_secs(50);

/// The query of an upload.
#[derive(Debug, Deserialize, utoipa::IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub(crate) struct UploadQuery {
    /// Number of the first frame in the body. Frame records have their own.
    #[serde(default)]
    first: u32,
    /// `all` (the default): every point of each frame. `handles`: the handle rows only; errors are not measured then.
    rows: Option<RowsQuery>,
    /// Begin the answer while the body still arrives. Only for connections that carry both directions at once: some proxies stop sending a
    /// request whose answer has begun.
    #[serde(default)]
    live: bool,
}

#[derive(Clone, Copy, Debug, Deserialize, utoipa::ToSchema)]
#[serde(rename_all = "lowercase")]
pub(crate) enum RowsQuery {
    All,
    Handles,
}

/// Posts frames. Any number of whole frames, back to back as little-endian f32, or frame records. The answer has one record
/// for each frame that is solved and on disk, in the order of solving. It begins when the whole body has arrived; with `live=true`, with the
/// first record. To watch an upload without it, follow `cages` or `events`. An error after the first record ends NDJSON with a line
/// of problem details, and cuts a stream of frame records off.
#[utoipa::path(
    post, path = "/v1/sessions/{id}/frames", operation_id = "post_frames", tag = "frames", params(openapi::Id, UploadQuery),
    request_body(content(
        (Vec<u8> = "application/octet-stream"), (Vec<u8> = "application/vnd.cager.frames"),
    ), description = "n × 3 numbers per frame, or one row per handle"),
    responses((status = 200, description = "One record per frame", content(
        (FrameResult = "application/x-ndjson"), (Vec<u8> = "application/vnd.cager.frames"),
    ))),
)]
pub(crate) async fn post(
    State(service): State<Arc<Service>>,
    Found { tenant, session }: Found,
    Query(query): Query<UploadQuery>,
    accept: Accept,
    request_id: Option<Extension<RequestId>>,
    headers: HeaderMap,
    body: Body,
) -> Result<Response, ApiError> {
    let records_out = match accept {
        Accept::Anything | Accept::Ndjson | Accept::Json => false,
        Accept::Records => true,
        _ => return Err(not_acceptable("application/x-ndjson or application/vnd.cager.frames")),
    };
    let rows = match query.rows {
        Some(RowsQuery::Handles) => Rows::Handles,
        _ => Rows::All,
    };
    let layout = match content_type(&headers).as_deref() {
        Some("application/octet-stream") => Layout::Raw { first: query.first, rows },
        Some(record::MEDIA_TYPE) => Layout::Records,
        _ => {
            let detail = "send frames as application/octet-stream or application/vnd.cager.frames";
            return Err(ApiError::new(problem::MEDIA_TYPE, detail));
        }
    };
    let place = service.stream(&tenant)?;
    let facts = prepared(&service, &session).await?;
    session.settled().await?;
    if rows == Rows::Handles && !facts.reads_handles_only {
        let detail =
            "this session reads every point (handles is all), so handle rows are not enough; post whole frames";
        return Err(ApiError::new(problem::INVALID_FRAME, detail));
    }
    let arriving = http_body::Body::size_hint(&body).exact().unwrap_or(0);
    let frame_bytes = 12 * u64::from(if rows == Rows::Handles { facts.handle_count } else { facts.points }.max(1));
    let record_bytes = 128 + 12 * u64::from(facts.unknowns);
    service.check_bytes(&tenant, (arriving / frame_bytes).saturating_mul(record_bytes))?;
    let solver = service.solver(&session).await?;
    let live = service.lane(&session, solver, &tenant);
    let upload = Arc::new(Upload::default());
    let answering = Answering { upload: Arc::clone(&upload), _live: Arc::clone(&live), _place: place };
    let reading = Reading { service, tenant, session: Arc::clone(&session), live, upload: Arc::clone(&upload) };
    let frames = FrameReader::new(layout, &facts);
    tokio::spawn(async move {
        reading.live.upload_begins();
        let mut body = body;
        let outcome = reading.read(&mut body, frames).await;
        reading.live.upload_ends();
        let refused = outcome.is_err() || reading.upload.is_pointless();
        reading.upload.close(outcome.err());
        if refused && !reading.upload.is_abandoned() {
            drain(body).await;
        }
    });
    if !query.live {
        upload.closed().await;
    }
    // An error before the first record still has a status of its own.
    let first = match tokio::time::timeout(HEAD_WITHIN, upload.next(ANSWERS)).await {
        Ok(Step::Failed(error)) => return Err(error),
        Ok(step) => Some(step),
        Err(_) => None,
    };
    let media_type = if records_out { record::MEDIA_TYPE } else { "application/x-ndjson" };
    let request_id = request_id.map(|Extension(id)| id.0.to_string());
    let stream = answers(answering, session, first, records_out, request_id);
    Ok(([(header::CONTENT_TYPE, media_type)], Body::from_stream(stream)).into_response())
}

pub(crate) fn not_acceptable(available: &str) -> ApiError {
    ApiError::new(problem::NOT_ACCEPTABLE, format!("accept {available}"))
}

/// The facts of a session that is ready; waits for one that is being prepared.
pub(crate) async fn prepared(service: &Service, session: &Arc<Session>) -> Result<Facts, ApiError> {
    let mut changes = session.changes();
    let deadline = Instant::now() + PREPARED_WITHIN;
    loop {
        changes.mark_unchanged();
        let status = session.status();
        match (status.phase, status.facts) {
            (Phase::Failed(problem), _) => {
                let detail = format!("the session failed: {}", problem.detail);
                return Err(ApiError::new(problem::SESSION_FAILED, detail));
            }
            (Phase::Preparing, _) | (_, None) => {}
            (_, Some(facts)) => {
                // It may have become ready since the request came.
                session.ensure_loaded().await?;
                return Ok(facts);
            }
        }
        tokio::select! {
            _ = changes.changed() => {}
            () = session.deleted().cancelled() => return Err(gone()),
            () = service.stopping().cancelled() => return Err(stopping()),
            () = sleep_until(deadline) => {
                let detail = "the session is still being prepared; wait until its state is ready";
                return Err(ApiError::new(problem::NOT_READY, detail).retry_after(2));
            }
        }
    }
}

pub(crate) fn stopping() -> ApiError {
    let detail = "the service is stopping; what was answered is kept, so post the rest when it is back";
    ApiError::new(problem::STOPPING, detail).retry_after(5)
}

/// Throws a refused body away for a while: many clients look at the answer only when they have written all.
async fn drain(mut body: Body) {
    let take = async {
        let mut left = DRAINED_BYTES;
        while let Some(Ok(frame)) = body.frame().await {
            left = left.saturating_sub(frame.data_ref().map_or(0, Bytes::len));
            if left == 0 {
                return;
            }
        }
    };
    // Whether it comes to an end does not matter.
    let _ = tokio::time::timeout(DRAINED_WITHIN, take).await;
}

pub(crate) fn too_slow() -> ApiError {
    ApiError::new(problem::REQUEST_TIMEOUT, "the body comes too slowly; send the rest again over a faster connection")
}

/// What a broken body means.
pub(crate) fn body_error(error: &(dyn std::error::Error + 'static)) -> ApiError {
    if super::listen::is_body_timeout(error) {
        return ApiError::new(problem::REQUEST_TIMEOUT, "the body stopped arriving; send the rest again");
    }
    ApiError::new(problem::BAD_REQUEST, format!("the body broke off ({error}); send the rest again"))
}

/// The half of an upload that reads its body.
struct Reading {
    service: Arc<Service>,
    tenant: Arc<Tenant>,
    session: Arc<Session>,
    live: Arc<LiveLane>,
    upload: Arc<Upload>,
}

impl Reading {
    async fn read(&self, body: &mut Body, mut frames: FrameReader) -> Result<(), ApiError> {
        let places = Arc::new(Semaphore::new(IN_FLIGHT));
        let unwritten = Arc::new(Semaphore::new(NOT_WRITTEN));
        let mut permits = None;
        let mut received = 0u64;
        let mut submitted = 0u64;
        let counter = metrics::counter!("cager_received_bytes_total", "tenant" => self.session.meta.tenant.clone());
        let stopped = async {
            tokio::select! {
                () = self.session.deleted().cancelled() => gone(),
                () = self.service.stopping().cancelled() => stopping(),
            }
        };
        tokio::pin!(stopped);
        let patience = Duration::from_secs(self.service.config.body_timeout_s);
        let mut late = Instant::now();
        loop {
            let next = tokio::select! {
                biased;
                error = &mut stopped => return Err(error),
                // A client that waits for an answer before it sends on must hear of an error all the same.
                () = self.upload.pointless() => return Ok(()),
                next = body.frame() => next,
                () = sleep_until(late), if permits.is_some() => return Err(too_slow()),
            };
            let chunk = match next {
                None => break,
                Some(Ok(frame)) => frame.into_data().unwrap_or_default(),
                Some(Err(error)) => return Err(body_error(&error)),
            };
            received += chunk.len() as u64;
            counter.increment(chunk.len() as u64);
            let mut input = &chunk[..];
            while !input.is_empty() {
                if self.upload.is_pointless() {
                    return Ok(());
                }
                if frames.is_between_frames() && permits.is_none() {
                    let room = async {
                        let open = "it is never closed";
                        let unwritten = Arc::clone(&unwritten).acquire_owned().await.expect(open);
                        let place = Arc::clone(&places).acquire_owned().await.expect(open);
                        let memory = &self.service.frame_memory;
                        let memory = memory.take(&self.tenant.name, frames.frame_bytes() as u64).await;
                        Permits { _solving: (place, memory), writing: unwritten }
                    };
                    permits = Some(tokio::select! {
                        error = &mut stopped => return Err(error),
                        () = self.upload.pointless() => return Ok(()),
                        permits = room => permits,
                        () = tokio::time::sleep(ROOM_WITHIN) => return Err(self.no_room()),
                    });
                    late = Instant::now()
                        + patience
                        + Duration::from_secs(frames.frame_bytes() as u64 / SLOWEST_BYTES_PER_SECOND);
                }
                if let Some(frame) = frames.push(&mut input)?
                    && let Some(permits) = permits.take()
                {
                    self.is_expected(frame.frame)?;
                    let job = FrameJob::new(&self.session, &self.upload, frame.frame, frame.rows, frame.bytes, permits);
                    self.live.lane.push(job);
                    submitted += 1;
                    if submitted.is_multiple_of(QUOTA_EVERY) {
                        self.service.check_bytes(&self.tenant, 0)?;
                    }
                }
            }
        }
        tracing::debug!(session = %self.session.meta.id, received, "upload read");
        frames.finish()
    }

    /// Refuses a number beyond those that the session was made for: it would only be found out at the end.
    fn is_expected(&self, frame: u32) -> Result<(), ApiError> {
        match self.session.meta.options.frames {
            Some(frames) if frame >= frames => {
                let detail = format!(
                    "frame {frame} is beyond the {frames} frames that the session was made for, which count from 0; check its number"
                );
                Err(ApiError::new(problem::INVALID_FRAME, detail).frame(frame))
            }
            _ => Ok(()),
        }
    }

    fn no_room(&self) -> ApiError {
        self.service.rejected("frame_memory");
        let detail = "the memory for frames is taken by others; send the rest in a moment";
        ApiError::new(problem::BUSY, detail).retry_after(5)
    }
}

/// The half of an upload that answers. Dropped when the client is gone.
struct Answering {
    upload: Arc<Upload>,
    /// Frames wait in the lane after the whole body has arrived, and a lane that is dropped forgets them.
    _live: Arc<LiveLane>,
    _place: Held,
}

impl Drop for Answering {
    fn drop(&mut self) {
        self.upload.abandon();
    }
}

fn answers(
    answering: Answering,
    session: Arc<Session>,
    first: Option<Step>,
    records: bool,
    request_id: Option<String>,
) -> impl futures_util::Stream<Item = io::Result<Bytes>> {
    futures_util::stream::unfold((first, answering), move |(step, answering)| {
        let (session, request_id) = (Arc::clone(&session), request_id.clone());
        async move {
            let step = match step {
                Some(step) => step,
                None => answering.upload.next(ANSWERS).await,
            };
            let item = match step {
                Step::Done => return None,
                Step::Frames(frames) => {
                    let entries: Vec<LogEntry> = {
                        let known = session.frames();
                        frames.iter().filter_map(|&frame| known.entry(frame).copied()).collect()
                    };
                    if records { as_records(session, entries).await } else { Ok(as_lines(&entries)) }
                }
                // What follows an error is the end.
                Step::Failed(error) if records => Err(error.into()),
                Step::Failed(mut error) => {
                    error.problem.request_id = request_id;
                    let mut line = serde_json::to_vec(&error.problem).unwrap_or_default();
                    line.push(b'\n');
                    Ok(line.into())
                }
            };
            Some((item, (None, answering)))
        }
    })
}

pub(crate) fn result_of(entry: &LogEntry) -> FrameResult {
    let measured = |x: f32| Some(x).filter(|x| !x.is_nan());
    FrameResult { frame: entry.frame, l2: measured(entry.l2), linf: measured(entry.linf) }
}

fn as_lines(entries: &[LogEntry]) -> Bytes {
    let mut lines = Vec::with_capacity(64 * entries.len());
    for entry in entries {
        if serde_json::to_writer(&mut lines, &result_of(entry)).is_ok() {
            lines.push(b'\n');
        }
    }
    lines.into()
}

/// Frame records of solved cages.
pub(crate) async fn as_records(session: Arc<Session>, entries: Vec<LogEntry>) -> io::Result<Bytes> {
    tokio::task::spawn_blocking(move || records_of(&session, &entries)).await.map_err(io::Error::other)?
}

/// As [`as_records`]. Blocks.
pub(crate) fn records_of(session: &Session, entries: &[LogEntry]) -> io::Result<Bytes> {
    let rows = session.facts().map_or(0, |facts| facts.unknowns);
    let mut cages = Vec::with_capacity(entries.len() * 12 * rows as usize);
    session.read_cages(entries, &mut cages)?;
    let mut out = Vec::with_capacity(cages.len() + entries.len() * record::HEADER_BYTES);
    for (entry, cage) in entries.iter().zip(cages.chunks_exact(12 * rows as usize)) {
        let crc = crc32c::crc32c(cage);
        let header = FrameHeader { kind: Kind::Cage, frame: entry.frame, rows, l2: entry.l2, linf: entry.linf, crc };
        out.extend_from_slice(&header.to_bytes());
        out.extend_from_slice(cage);
    }
    Ok(out.into())
}
