//! What comes of a transfer: positions as they are moved, the container and the report.

use crate::http::extract::{Query, RequestedJob};
use crate::http::job_frames::{FramesOfJob, stream};
use crate::http::{jobs, openapi};
use crate::problem::ApiError;
use crate::service::Service;
use crate::transfers::{Transfer, TransferFrames};
use axum::extract::State;
use axum::response::Response;
use http::HeaderMap;
use std::sync::Arc;

/// Frames read and sent at a time, at most, and their bytes, unless one is larger.
const PIECE_FRAMES: u64 = 16;
const PIECE_BYTES: u64 = 8 << 20;

/// Positions of the target: n × 3 little-endian f32 a frame. While the transfer runs those that are moved so far, before feet are held to the floor; of a
/// completed one what a decoder of its container gets back. A reader who began while it ran gets all frames as they were moved.
#[utoipa::path(
    get, path = "/v1/transfers/{id}/frames", operation_id = "get_transferred_frames", tag = "transfers", params(openapi::JobId, FramesOfJob),
    responses((status = 200, description = "The positions", content_type = "application/octet-stream", body = Vec<u8>)),
)]
pub(crate) async fn frames(
    State(service): State<Arc<Service>>,
    RequestedJob { job, tenant }: RequestedJob<Transfer>,
    Query(query): Query<FramesOfJob>,
) -> Result<Response, ApiError> {
    let there = query.there(&job, job.progress().moved)?;
    let frame_bytes = 12 * u64::from(job.meta.points);
    let piece = (PIECE_BYTES / frame_bytes).clamp(1, PIECE_FRAMES);
    let frames = Box::new(TransferFrames::new(Arc::clone(&service)));
    stream(service, &tenant, job, (query, there), (piece as u32, piece * frame_bytes), frames)
}

/// The container of a completed transfer, byte for byte what `cager transfer` writes for the same files and options.
#[utoipa::path(
    get, path = "/v1/transfers/{id}/capture.cager", operation_id = "get_transferred_container", tag = "transfers",
    params(openapi::JobId, openapi::Conditions),
    responses(
        (status = 200, description = "The container", content_type = "application/vnd.cager", body = Vec<u8>),
        (status = 206, description = "The range asked for", content_type = "application/vnd.cager", body = Vec<u8>),
        (status = 304, description = "The client's copy is current"),
    ),
)]
pub(crate) async fn container(
    State(service): State<Arc<Service>>,
    RequestedJob { job, tenant }: RequestedJob<Transfer>,
    headers: HeaderMap,
) -> Result<Response, ApiError> {
    jobs::result(&service, &tenant, &job, None, ("capture.cager", "application/vnd.cager"), &headers).await
}

/// How source and target were brought together, as `cager transfer --report` writes it.
#[utoipa::path(
    get, path = "/v1/transfers/{id}/report", operation_id = "get_transfer_report", tag = "transfers",
    params(openapi::JobId, openapi::Conditions),
    responses(
        (status = 200, description = "The report", content_type = "application/json", body = Object),
        (status = 206, description = "The range asked for", content_type = "application/json", body = Object),
        (status = 304, description = "The client's copy is current"),
    ),
)]
pub(crate) async fn report(
    State(service): State<Arc<Service>>,
    RequestedJob { job, tenant }: RequestedJob<Transfer>,
    headers: HeaderMap,
) -> Result<Response, ApiError> {
    jobs::result(&service, &tenant, &job, None, ("report.json", "application/json"), &headers).await
}
