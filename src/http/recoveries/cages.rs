//! `GET /v1/recoveries/{id}/cages`: cages as frames are followed, and in the end those of the whole.

use super::results::file;
use crate::admission::Held;
use crate::http::extract::{Query, RequestedJob};
use crate::http::openapi;
use crate::jobs::Phase;
use crate::problem::{self, ApiError};
use crate::recovery::{Finished, Recovery, RecoveryJob};
use crate::service::Service;
use crate::tasks::blocking;
use axum::body::Body;
use axum::extract::State;
use axum::response::{IntoResponse, Response};
use bytes::Bytes;
use http::{HeaderMap, header};
use serde::Deserialize;
use std::io;
use std::sync::Arc;

const OCTETS: &str = "application/octet-stream";
/// Frames read and sent at a time.
const PIECE_FRAMES: u32 = 64;

/// Which cages.
#[derive(Debug, Deserialize, utoipa::IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub(crate) struct CagesQuery {
    /// First frame.
    #[serde(default)]
    first: u32,
    /// Number of frames; all that are there where it is left out.
    count: Option<u32>,
    /// Keep the stream open for frames still to be followed, in order, to the last one. It breaks off where the recovery is completed before all cages
    /// of the first pass are sent, since the final ones are others.
    #[serde(default)]
    follow: bool,
}

/// Cages: m × 3 little-endian f32 each, `cage_vertices` of the recovery. As frames come those of the first pass; of a completed recovery the final ones,
/// which never change: they have an `ETag` and take `Range`.
#[utoipa::path(
    get, path = "/v1/recoveries/{id}/cages", operation_id = "get_recovered_cages", tag = "recoveries", params(openapi::RecoveryId, CagesQuery, openapi::Conditions),
    responses(
        (status = 200, description = "The cages", content_type = "application/octet-stream", body = Vec<u8>),
        (status = 206, description = "The range asked for", content_type = "application/octet-stream", body = Vec<u8>),
        (status = 304, description = "The client's copy is current"),
    ),
)]
pub(crate) async fn get(
    State(service): State<Arc<Service>>,
    RequestedJob { job, tenant }: RequestedJob<Recovery>,
    Query(CagesQuery { first, count, follow }): Query<CagesQuery>,
    headers: HeaderMap,
) -> Result<Response, ApiError> {
    if let Phase::Failed(problem) = job.phase() {
        return Err(ApiError::new(problem::RECOVERY_FAILED, problem.detail));
    }
    let place = service.stream(&tenant)?;
    let there = job.view().frames.followed.saturating_sub(first);
    if let Some(count) = count.filter(|&count| !follow && count > there) {
        let detail =
            format!("{there} of the {count} frames from {first} on are followed; request fewer, or use follow=true");
        return Err(ApiError::new(problem::FRAMES_MISSING, detail));
    }
    let finished = job.finished().ok();
    if let Some(finished) = finished.as_ref().filter(|_| !follow) {
        let stride = 12 * u64::from(finished.cage_vertices);
        let begin = stride * u64::from(first);
        let bytes = begin..begin + stride * u64::from(count.unwrap_or(there));
        return file(&service, &tenant, &job, Some(bytes), ("cages", OCTETS), &headers).await;
    }
    let end = match (count, follow) {
        (Some(count), _) => Some(first.saturating_add(count)),
        (None, true) => None,
        (None, false) => Some(first + there),
    };
    let following = Following { service, job, finished, next: first, end, _place: place };
    let stream = futures_util::stream::unfold(Some(following), |following| async move {
        let mut following = following?;
        match following.piece().await {
            Ok(Some(bytes)) => Some((Ok(bytes), Some(following))),
            Ok(None) => None,
            Err(error) => Some((Err(error), None)),
        }
    });
    let headers = [(header::CONTENT_TYPE, OCTETS), (header::CACHE_CONTROL, "no-store")];
    Ok((headers, Body::from_stream(stream)).into_response())
}

/// Cages on their way to a client.
struct Following {
    service: Arc<Service>,
    job: Arc<RecoveryJob>,
    /// What is completed already: its cages are the final ones. Others get those of the first pass, and never both.
    finished: Option<Box<Finished>>,
    next: u32,
    /// The frame after the last one, where that is known.
    end: Option<u32>,
    _place: Held,
}

impl Following {
    /// The next cages; nothing after the last one.
    async fn piece(&mut self) -> io::Result<Option<Bytes>> {
        let mut changes = self.job.changes();
        loop {
            changes.mark_unchanged();
            let left = self.end.map_or(PIECE_FRAMES, |end| end.saturating_sub(self.next).min(PIECE_FRAMES));
            if left == 0 || self.job.deleted().is_cancelled() {
                return Ok(None);
            }
            let (cages, is_last) = self.read(left).await?;
            if !cages.is_empty() {
                let vertices = self.finished.as_ref().map(|finished| finished.cage_vertices);
                let stride = 12 * vertices.or(self.job.view().cage_vertices).unwrap_or(1);
                self.next += cages.len() as u32 / stride.max(1);
                return Ok(Some(cages.into()));
            }
            if is_last {
                return Ok(None);
            }
            tokio::select! {
                _ = changes.changed() => {}
                () = self.job.deleted().cancelled() => return Ok(None),
                () = self.service.stopping().cancelled() => return Err(io::Error::other("the service is stopping")),
            }
        }
    }

    /// Cages found so far from a frame on, and whether no more will follow.
    async fn read(&self, most: u32) -> io::Result<(Vec<u8>, bool)> {
        let (job, store, next) = (Arc::clone(&self.job), self.service.store.clone(), self.next);
        if let Some(finished) = self.finished.clone() {
            let read = blocking(move || {
                let read = job.final_cages(&store, &finished, (next, most));
                read.map_err(|error| job.fail_if_damaged(&store, error))
            });
            return Ok((read.await.map_err(io::Error::from)??, true));
        }
        if let Some((cages, total)) = blocking(move || job.first_cages(next, most)).await.map_err(io::Error::from)? {
            return Ok((cages, total.is_some_and(|total| next >= total)));
        }
        match self.job.finished() {
            Ok(finished) if next >= finished.frames => Ok((Vec::new(), true)),
            Ok(_) => Err(io::Error::other("the recovery is completed, and its cages are other ones now")),
            Err(_) => Err(io::Error::other("the recovery failed")),
        }
    }
}
