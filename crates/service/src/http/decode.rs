//! `POST /v1/sessions/{id}/decode`: cages in, positions out.

use super::decode_layer::{self, LayerQuery};
use super::extract::{Query, RequestedSession, content_type};
use super::waiting::{body_error, prepared, stopping};
use super::{openapi, other_model};
use crate::admission::{Budget, Permit};
use crate::engine::Lane;
use crate::file_bodies::{TELLING_BYTES, refuse_file};
use crate::problem::{self, ApiError};
use crate::service::Service;
use crate::session::{Session, gone};
use crate::store::StoreError;
use crate::sync::lock;
use axum::body::Body;
use axum::extract::{Request, State};
use axum::response::{IntoResponse, Response};
use bytes::Bytes;
use cager_proto::le;
use futures_util::StreamExt as _;
use futures_util::stream::BoxStream;
use http::{HeaderValue, header};
use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom, Write};
use std::path::Path;
use std::sync::{Arc, Mutex};
use tokio::sync::{oneshot, watch};

/// Positions of a cage: m × 3 little-endian f32 in, n × 3 out, for as many cages as the body has. Cages may be edited.
///
/// As a form, another model that lies in the same rest cage is moved instead: its points are those of the file in the part `model`, and
/// `Cager-Outside` says how many of them lie outside the rest cage, and `Cager-Bound` how many lie beside poles of its coordinates and follow the nearest
/// places of the session's own model.
///
/// With `layer` and no body, the session's own frames are decoded, where their frames are coded up to the last group that is.
#[utoipa::path(
    post, path = "/v1/sessions/{id}/decode", operation_id = "decode_cages", tag = "results", params(openapi::Id, LayerQuery),
    request_body(description = "m × 3 numbers per cage", content(
        (Vec<u8> = "application/octet-stream"), (openapi::OtherModelForm = "multipart/form-data"),
    )),
    responses((status = 200, description = "n × 3 numbers per cage", content_type = "application/octet-stream", body = Vec<u8>,
        headers(
            ("Cager-Outside" = u32, description = "With another model: its points outside the rest cage"),
            ("Cager-Bound" = u32, description = "With another model: its points that follow the session's own model"),
        ))),
)]
pub(crate) async fn post(
    State(service): State<Arc<Service>>,
    RequestedSession { session, tenant }: RequestedSession,
    Query(query): Query<LayerQuery>,
    request: Request,
) -> Result<Response, ApiError> {
    if query.is_given() {
        if http_body::Body::size_hint(request.body()).exact() != Some(0) {
            let detail =
                "with layer, frames of the session are decoded; send no body, or leave layer, first and count out";
            return Err(ApiError::new(problem::BAD_REQUEST, detail));
        }
        return decode_layer::respond(service, session, &tenant, query).await;
    }
    let media_type = content_type(request.headers());
    let with_model = match media_type.as_deref() {
        Some("application/octet-stream") => false,
        Some("multipart/form-data") => true,
        _ => {
            let detail = "send cages as application/octet-stream, or a model and cages as multipart/form-data; or nothing, with layer=cages or layer=all";
            return Err(ApiError::new(problem::MEDIA_TYPE, detail));
        }
    };
    service.check_queue(&tenant)?;
    let place = service.stream(&tenant)?;
    let facts = prepared(&service, &session).await?;
    let (model, cages, declared) = if with_model {
        let (model, cages) = other_model::read(&service, &tenant, request).await?;
        (Some(model), cages, None)
    } else {
        let declared = http_body::Body::size_hint(request.body()).exact();
        let cages = request.into_body().into_data_stream().map(|piece| piece.map_err(|error| body_error(&error)));
        (None, cages.boxed(), declared)
    };
    // The body is spooled before the model is bound, so that the client can keep sending meanwhile.
    let space = Permit::empty(&service.spool_space, &tenant.name);
    let spool = Arc::new(PositionSpool::new(&service.config.data, space).map_err(spool_error)?);
    let arrived = spool.arrived.subscribe();
    let limit = service.config.max_rest_bytes;
    tokio::spawn(spool_cages(Arc::clone(&spool), cages, limit, Arc::clone(&service), Arc::clone(&session)));
    let (decoder, counts) = match model {
        Some(model) => {
            let bound = other_model::bind(&service, &session, &tenant.name, model).await?;
            (bound.decoder, Some((bound.outside, bound.bound)))
        }
        None => (service.solver(&session).await?.solver.decoder().clone(), None),
    };
    let cost = decoder.points() as f64 * decoder.columns() as f64;
    let lane = service.engine.lane(&tenant.name, tenant.priority.weight(), cost, move |jobs: Vec<Job>| {
        let (cages, replies): (Vec<_>, Vec<_>) = jobs.into_iter().map(|job| (job.cage, job.reply)).unzip();
        let views: Vec<&[f32]> = cages.iter().map(Vec::as_slice).collect();
        let mut positions = vec![Vec::new(); cages.len()];
        decoder.decode(&views, &mut positions);
        for (positions, reply) in positions.into_iter().zip(replies) {
            let bytes = le::f32_bytes(&positions);
            // The client may be gone.
            let _ = reply.send(bytes.into());
        }
    });
    let frame_bytes = 12 * u64::from(facts.unknowns);
    let queued = Arc::clone(&service.queued_frames);
    let mut decoding = CageDecoding { spool, arrived, lane, session, queued, frame_bytes, next: 0, _place: place };
    // Wait for the first result, so that its error can have an HTTP status, as what is known of the end by then.
    let first = decoding.next().await?;
    decoding.ends_whole(declared)?;
    let rest = futures_util::stream::unfold(decoding, |mut decoding| async {
        match decoding.next().await {
            Ok(None) => None,
            Ok(Some(bytes)) => Some((Ok::<_, io::Error>(bytes), decoding)),
            Err(error) => Some((Err(error.into()), decoding)),
        }
    });
    let first = futures_util::stream::iter(first.map(Ok));
    let body = Body::from_stream(first.chain(rest));
    let mut response = ([(header::CONTENT_TYPE, "application/octet-stream")], body).into_response();
    if let Some((outside, bound)) = counts {
        response.headers_mut().insert("cager-outside", HeaderValue::from(outside));
        response.headers_mut().insert("cager-bound", HeaderValue::from(bound));
    }
    Ok(response)
}

struct Job {
    cage: Vec<f32>,
    reply: oneshot::Sender<Bytes>,
}

/// The request body on disk: a client that reads the response only after sending the whole body must not block.
struct PositionSpool {
    file: Mutex<File>,
    /// Permit for its disk space.
    space: Mutex<Permit>,
    arrived: watch::Sender<Arrived>,
}

#[derive(Clone, Default)]
struct Arrived {
    bytes: u64,
    end: Option<Result<(), ApiError>>,
}

impl PositionSpool {
    /// In the data folder, the only place that the service may write to.
    fn new(data: &Path, space: Permit) -> io::Result<Self> {
        let file = Mutex::new(tempfile::tempfile_in(data.join("tmp"))?);
        Ok(Self { file, space: Mutex::new(space), arrived: watch::Sender::default() })
    }

    fn append(&self, at: u64, bytes: &[u8]) -> io::Result<()> {
        let mut file = lock(&self.file);
        file.seek(SeekFrom::Start(at))?;
        file.write_all(bytes)
    }

    fn read(&self, at: u64, length: usize) -> io::Result<Vec<u8>> {
        let mut file = lock(&self.file);
        file.seek(SeekFrom::Start(at))?;
        let mut bytes = vec![0; length];
        file.read_exact(&mut bytes)?;
        Ok(bytes)
    }
}

async fn spool_cages(
    spool: Arc<PositionSpool>,
    mut cages: BoxStream<'static, Result<Bytes, ApiError>>,
    limit: u64,
    service: Arc<Service>,
    session: Arc<Session>,
) {
    let mut bytes = 0u64;
    let end = loop {
        let next = tokio::select! {
            next = cages.next() => next,
            () = session.deleted().cancelled() => break Err(gone()),
            () = service.stopping().cancelled() => break Err(stopping()),
            () = spool.arrived.closed() => return,
        };
        let chunk = match next {
            None => break Ok(()),
            Some(Ok(chunk)) => chunk,
            Some(Err(error)) => break Err(error),
        };
        if bytes + chunk.len() as u64 > limit {
            let detail = format!("the cages take more than {limit} bytes; decode fewer at a time");
            break Err(ApiError::new(problem::TOO_LARGE, detail).limit(limit));
        }
        let (writing, length) = (Arc::clone(&spool), chunk.len() as u64);
        let grown = lock(&spool.space).grow(length);
        if let Err(full) = grown {
            service.rejected("spool_space");
            break Err(full.refusal("disk space for cages to decode"));
        }
        match tokio::task::spawn_blocking(move || writing.append(bytes, &chunk)).await {
            Ok(Ok(())) => bytes += length,
            Ok(Err(error)) => break Err(spool_error(error)),
            Err(error) => break Err(ApiError::internal(&error)),
        }
        spool.arrived.send_modify(|arrived| arrived.bytes = bytes);
    };
    spool.arrived.send_modify(|arrived| arrived.end = Some(end));
}

fn spool_error(error: io::Error) -> ApiError {
    StoreError::of(Path::new("tmp"), "write cages to", error).into()
}

/// Produces the response body.
struct CageDecoding {
    spool: Arc<PositionSpool>,
    arrived: watch::Receiver<Arrived>,
    lane: Lane<Job>,
    session: Arc<Session>,
    /// Cages that wait to be decoded, beside the frames that wait.
    queued: Arc<Budget>,
    frame_bytes: u64,
    next: u64,
    _place: Permit,
}

/// Bytes of the body that have arrived.
async fn read(spool: Arc<PositionSpool>, at: u64, length: u64) -> Result<Vec<u8>, ApiError> {
    let read = crate::tasks::blocking(move || spool.read(at, length as usize)).await?;
    read.map_err(|error| ApiError::internal(&error))
}

impl CageDecoding {
    /// Checks that the body has whole cages, where its length is declared or it has ended.
    ///
    /// # Errors
    /// It ends within a cage.
    fn ends_whole(&self, declared: Option<u64>) -> Result<(), ApiError> {
        let arrived = self.arrived.borrow();
        match declared.or_else(|| matches!(arrived.end, Some(Ok(()))).then_some(arrived.bytes)) {
            Some(bytes) if !bytes.is_multiple_of(self.frame_bytes) => Err(self.cut_off(bytes)),
            _ => Ok(()),
        }
    }

    /// The response for a body of so many bytes, whose last cage is not whole.
    fn cut_off(&self, bytes: u64) -> ApiError {
        let (cage, rest) = (bytes / self.frame_bytes, bytes % self.frame_bytes);
        let of = self.frame_bytes;
        let detail = format!("the body ends within cage {cage}, after {rest} of {of} bytes; send whole cages");
        ApiError::new(problem::BAD_REQUEST, detail)
    }

    /// Positions of the next few cages; `None` at the end of the body.
    async fn next(&mut self) -> Result<Option<Bytes>, ApiError> {
        const AT_A_TIME: u64 = 4;
        let at = self.next * self.frame_bytes;
        let count = loop {
            let arrived = self.arrived.borrow_and_update().clone();
            let whole = (arrived.bytes - at) / self.frame_bytes;
            if whole > 0 {
                break whole.min(AT_A_TIME);
            }
            match arrived.end {
                Some(Err(error)) => return Err(error),
                Some(Ok(())) if arrived.bytes == at => return Ok(None),
                Some(Ok(())) => {
                    if at == 0 {
                        let length = arrived.bytes.min(TELLING_BYTES as u64);
                        refuse_file(&read(Arc::clone(&self.spool), 0, length).await?)?;
                    }
                    return Err(self.cut_off(arrived.bytes));
                }
                None => {}
            }
            if self.arrived.changed().await.is_err() {
                return Err(ApiError::internal(&"a spool ended early"));
            }
        };
        let bytes = read(Arc::clone(&self.spool), at, count * self.frame_bytes).await?;
        if at == 0 {
            refuse_file(&bytes)?;
        }
        let _queued = self.queued.take(&self.session.meta.tenant, count).await;
        let mut replies = Vec::new();
        for cage in bytes.chunks_exact(self.frame_bytes as usize) {
            if let Some(k) = le::first_not_finite(cage) {
                let detail = format!("cage {}: vertex {} is not finite", self.next, k / 3);
                return Err(ApiError::new(problem::INVALID_FRAME, detail));
            }
            let (reply, positions) = oneshot::channel();
            self.lane.push(Job { cage: le::f32s(cage), reply });
            replies.push(positions);
            self.next += 1;
        }
        let mut out = Vec::new();
        for reply in replies {
            let positions = tokio::select! {
                positions = reply => positions.map_err(|_| ApiError::internal(&"a batch of cages was lost"))?,
                () = self.session.deleted().cancelled() => return Err(gone()),
            };
            out.extend_from_slice(&positions);
        }
        Ok(Some(out.into()))
    }
}
