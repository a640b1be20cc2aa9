//! `POST /v1/sessions/{id}/frames`: receives frames and responds with one record per frame, optionally while the upload runs.

use super::extract::{Accept, Query, RequestedSession, content_type};
use super::frame_parser::{BodyLayout, FrameReader, RowsQuery};
use super::openapi;
use super::solved_frames::{as_lines, as_records};
use super::waiting::{SLOWEST_BYTES_PER_SECOND, body_error, not_acceptable, prepared, stopping, too_slow};
use crate::admission::Permit;
use crate::auth::Tenant;
use crate::problem::{self, ApiError};
use crate::service::Service;
use crate::session::commit::frame_bytes as stored_bytes;
use crate::session::registry::Reserved;
use crate::session::upload::{FrameJob, Permits, Upload, UploadEvent};
use crate::session::{Session, SessionQueue, gone};
use crate::store::FrameEntry;
use crate::telemetry::RequestId;
use axum::Extension;
use axum::body::Body;
use axum::extract::State;
use axum::response::{IntoResponse, Response};
use bytes::Bytes;
use cager_core::inversion::Rows;
use cager_proto::messages::FrameResult;
use cager_proto::record;
use http::{HeaderMap, header};
use http_body_util::BodyExt;
use serde::Deserialize;
use std::io;
use std::sync::Arc;
use std::time::Duration;
use tokio::sync::Semaphore;
use tokio::time::{Instant, sleep_until};

/// Frames of one upload that are queued or being solved: enough to keep the pool busy.
const MAX_IN_FLIGHT: usize = 64;
/// Frames that quota is reserved for at a time, and bytes of them; a larger frame alone.
const RESERVED_FRAMES: u64 = 64;
const RESERVED_BYTES: u64 = 16 << 20;
/// Frames of one upload that are not on disk yet: enough to bridge a slow sync, and a bound if the disk hangs.
const MAX_UNWRITTEN: usize = 512;
/// Records sent at a time.
const ANSWERS: usize = 64;
/// Longest delay of the response header until the first record; some clients time out on a silent server.
const FIRST_RECORD_TIMEOUT: Duration = Duration::from_secs(5);
/// How much of a refused body is read and discarded, and for how long.
const MAX_DRAIN_BYTES: usize = 64 << 20;
const DRAIN_TIMEOUT: Duration = Duration::from_secs(5);
/// How long a frame waits for memory.
const MEMORY_TIMEOUT: Duration = Duration::from_secs(30);
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
    RequestedSession { tenant, session }: RequestedSession,
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
        Some("application/octet-stream") => BodyLayout::Raw { first: query.first, rows },
        Some(record::MEDIA_TYPE) => BodyLayout::Records,
        _ => {
            let detail = "send frames as application/octet-stream or application/vnd.cager.frames";
            return Err(ApiError::new(problem::MEDIA_TYPE, detail));
        }
    };
    service.check_queue(&tenant)?;
    let place = service.stream(&tenant)?;
    let facts = prepared(&service, &session).await?;
    session.completion_resolved().await?;
    session.check_coding()?;
    if rows == Rows::Handles && !facts.reads_handles_only {
        let detail = "this session needs every point, since handles is all, or an error, a size or a quality was asked for; post whole frames";
        return Err(ApiError::new(problem::INVALID_FRAME, detail));
    }
    let arriving = http_body::Body::size_hint(&body).exact().unwrap_or(0);
    let frame_bytes = 12 * u64::from(if rows == Rows::Handles { facts.handle_count } else { facts.points }.max(1));
    let record_bytes = stored_bytes(facts.unknowns as usize, 0);
    service.check_bytes(&tenant, (arriving / frame_bytes).saturating_mul(record_bytes))?;
    let posted = if session.goal().is_some() { frame_bytes as usize } else { 0 };
    let stored_bytes = stored_bytes(facts.unknowns as usize, posted);
    let solver = service.solver(&session).await?;
    let live = service.lane(&session, solver, &tenant);
    let upload = Arc::new(Upload::default());
    let answering = UploadResponder { upload: Arc::clone(&upload), _live: Arc::clone(&live), _place: place };
    let of = Arc::clone(&session);
    let reading = UploadReader { service, tenant, session: of, live, upload: Arc::clone(&upload), stored_bytes };
    let frames = FrameReader::new(layout, &facts);
    tokio::spawn(async move {
        reading.live.upload_begins();
        let mut body = body;
        let outcome = reading.read(&mut body, frames).await;
        reading.live.upload_ends();
        let refused = outcome.is_err() || reading.upload.is_aborted();
        reading.upload.close(outcome.err());
        if refused && !reading.upload.is_abandoned() {
            drain(body).await;
        }
    });
    if !query.live {
        upload.closed().await;
    }
    // An error before the first record can still have an HTTP status.
    let first = match tokio::time::timeout(FIRST_RECORD_TIMEOUT, upload.next(ANSWERS)).await {
        Ok(UploadEvent::Failed(error)) => return Err(error),
        Ok(step) => Some(step),
        Err(_) => None,
    };
    let media_type = if records_out { record::MEDIA_TYPE } else { "application/x-ndjson" };
    let request_id = request_id.map(|Extension(id)| id.0.to_string());
    let stream = answers(answering, session, first, records_out, request_id);
    Ok(([(header::CONTENT_TYPE, media_type)], Body::from_stream(stream)).into_response())
}

/// Reads and discards a refused body for a while: many clients read the response only after sending the whole body.
async fn drain(mut body: Body) {
    let take = async {
        let mut left = MAX_DRAIN_BYTES;
        while let Some(Ok(frame)) = body.frame().await {
            left = left.saturating_sub(frame.data_ref().map_or(0, Bytes::len));
            if left == 0 {
                return;
            }
        }
    };
    // A timeout is not an error here.
    let _ = tokio::time::timeout(DRAIN_TIMEOUT, take).await;
}

/// The half of an upload that reads the body.
struct UploadReader {
    service: Arc<Service>,
    tenant: Arc<Tenant>,
    session: Arc<Session>,
    live: Arc<SessionQueue>,
    upload: Arc<Upload>,
    /// Bytes on disk of a frame.
    stored_bytes: u64,
}

impl UploadReader {
    async fn read(&self, body: &mut Body, mut frames: FrameReader) -> Result<(), ApiError> {
        let places = Arc::new(Semaphore::new(MAX_IN_FLIGHT));
        let unwritten = Arc::new(Semaphore::new(MAX_UNWRITTEN));
        let mut permits = None;
        let mut received = 0u64;
        let mut reserved = None;
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
                // Without this, a client that waits for a response before it sends more would never see an error.
                () = self.upload.aborted() => return Ok(()),
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
                if self.upload.is_aborted() {
                    return Ok(());
                }
                if frames.is_between_frames() && permits.is_none() {
                    let room = async {
                        let open = "it is never closed";
                        let unwritten = Arc::clone(&unwritten).acquire_owned().await.expect(open);
                        let place = Arc::clone(&places).acquire_owned().await.expect(open);
                        let (tenant, bytes) = (&self.tenant.name, frames.frame_bytes() as u64);
                        let queued = self.service.queued_frames.take(tenant, 1).await;
                        let memory = self.service.frame_memory.take(tenant, bytes).await;
                        Permits { solving: Some((place, [queued, memory])), _writing: unwritten, quota: None }
                    };
                    permits = Some(tokio::select! {
                        error = &mut stopped => return Err(error),
                        () = self.upload.aborted() => return Ok(()),
                        permits = room => permits,
                        () = tokio::time::sleep(MEMORY_TIMEOUT) => return Err(self.no_room()),
                    });
                    late = Instant::now()
                        + patience
                        + Duration::from_secs(frames.frame_bytes() as u64 / SLOWEST_BYTES_PER_SECOND);
                }
                if let Some(frame) = frames.push(&mut input)?
                    && let Some(mut permits) = permits.take()
                {
                    self.is_expected(frame.frame)?;
                    permits.quota = Some(self.quota(&mut reserved)?);
                    let job = FrameJob::new(&self.session, &self.upload, frame.frame, frame.rows, frame.bytes, permits);
                    self.live.lane.push(job);
                }
            }
        }
        tracing::debug!(session = %self.session.meta.id, received, "upload read");
        frames.finish()
    }

    /// Quota for the next frame, of what is reserved for several.
    fn quota(&self, reserved: &mut Option<Reserved>) -> Result<Reserved, ApiError> {
        if let Some(one) = reserved.as_mut().and_then(|several| several.split(self.stored_bytes)) {
            return Ok(one);
        }
        *reserved = None;
        let most = (RESERVED_BYTES / self.stored_bytes).clamp(1, RESERVED_FRAMES);
        let several = reserved.insert(self.service.reserve_frames(&self.tenant, self.stored_bytes, most)?);
        several.split(self.stored_bytes).ok_or_else(|| ApiError::internal(&"less quota than for one frame"))
    }

    /// Refuses frame numbers beyond the declared number of frames early, not only at completion.
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

/// The half of an upload that responds. Dropped when the client disconnects.
struct UploadResponder {
    upload: Arc<Upload>,
    /// Keeps the lane open: frames may still be queued after the whole body has arrived.
    _live: Arc<SessionQueue>,
    _place: Permit,
}

impl Drop for UploadResponder {
    fn drop(&mut self) {
        self.upload.abandon();
    }
}

fn answers(
    answering: UploadResponder,
    session: Arc<Session>,
    first: Option<UploadEvent>,
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
                UploadEvent::Done => return None,
                UploadEvent::Frames(frames) => {
                    let entries: Vec<FrameEntry> = {
                        let known = session.frames();
                        frames.iter().filter_map(|&frame| known.entry(frame).copied()).collect()
                    };
                    if records { as_records(session, entries).await } else { Ok(as_lines(&entries)) }
                }
                // An error ends the stream.
                UploadEvent::Failed(error) if records => Err(error.into()),
                UploadEvent::Failed(mut error) => {
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
