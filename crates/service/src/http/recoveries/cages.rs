//! `GET /v1/recoveries/{id}/cages`: cages as frames are followed, and in the end those of the whole.

use crate::http::extract::{Query, RequestedJob};
use crate::http::job_frames::{FramesOfJob, OCTETS, stream};
use crate::http::{jobs, openapi};
use crate::problem::ApiError;
use crate::recovery::{Recovery, RecoveryJob};
use crate::service::Service;
use axum::extract::State;
use axum::response::Response;
use http::HeaderMap;
use std::sync::Arc;

/// Frames read and sent at a time.
const PIECE_FRAMES: u32 = 64;

/// Cages: m × 3 little-endian f32 each, `cage_vertices` of the recovery. As frames come those of the first pass; of a completed recovery the final ones,
/// which never change: they have an `ETag` and take `Range`. With `follow`, the stream breaks off where the recovery is completed before all cages of the
/// first pass are sent, since the final ones are others.
#[utoipa::path(
    get, path = "/v1/recoveries/{id}/cages", operation_id = "get_recovered_cages", tag = "recoveries", params(openapi::JobId, FramesOfJob, openapi::Conditions),
    responses(
        (status = 200, description = "The cages", content_type = "application/octet-stream", body = Vec<u8>),
        (status = 206, description = "The range asked for", content_type = "application/octet-stream", body = Vec<u8>),
        (status = 304, description = "The client's copy is current"),
    ),
)]
pub(crate) async fn get(
    State(service): State<Arc<Service>>,
    RequestedJob { job, tenant }: RequestedJob<Recovery>,
    Query(query): Query<FramesOfJob>,
    headers: HeaderMap,
) -> Result<Response, ApiError> {
    let there = query.there(&job, job.view().frames.followed)?;
    // What is completed already has its final cages, others those of the first pass, and nobody both.
    let finished = job.finished().ok();
    if let Some(finished) = finished.as_ref().filter(|_| !query.follow) {
        let stride = 12 * u64::from(finished.cage_vertices);
        let begin = stride * u64::from(query.first);
        let bytes = begin..begin + stride * u64::from(query.count.unwrap_or(there));
        return jobs::result(&service, &tenant, &job, Some(bytes), ("cages", OCTETS), &headers).await;
    }
    let store = service.store.clone();
    let read = Box::new(move |job: &RecoveryJob, next: u32, most: u32| match &finished {
        Some(finished) => job.final_cages(&store, finished, (next, most)),
        None => job.first_cages(next, most),
    });
    stream(service, &tenant, job, (query, there), (PIECE_FRAMES, 0), read)
}
