//! Listing, looking at, following and deleting transfers.

use crate::http::extract::{Caller, Query, Requested, RequestedJob};
use crate::http::progress::Event;
use crate::http::progress::ProgressEvent;
use crate::http::respond::JsonResult;
use crate::http::sessions::PageQuery;
use crate::http::{jobs, openapi};
use crate::problem::ApiError;
use crate::service::Service;
use crate::transfers::{Transfer, TransferJob};
use axum::Json;
use axum::extract::State;
use axum::response::Response;
use cager_proto::transfer_messages::{Transfer as View, TransferList};
use http::{HeaderMap, StatusCode};
use std::sync::Arc;

/// Lists the tenant's transfers, newest first, a hundred at a time.
#[utoipa::path(get, path = "/v1/transfers", operation_id = "list_transfers", tag = "transfers", params(PageQuery), responses((status = 200, description = "A page of transfers", body = TransferList)))]
pub(crate) async fn list(
    State(service): State<Arc<Service>>,
    Caller(tenant): Caller,
    query: Query<PageQuery>,
) -> JsonResult<TransferList> {
    let (transfers, next) = jobs::page(&service, &tenant, &query, TransferJob::view)?;
    Ok(Json(TransferList { transfers, next }))
}

/// A transfer.
#[utoipa::path(get, path = "/v1/transfers/{id}", operation_id = "get_transfer", tag = "transfers", params(openapi::JobId), responses((status = 200, description = "The transfer", body = View)))]
pub(crate) async fn get(RequestedJob { job, .. }: RequestedJob<Transfer>) -> Json<View> {
    Json(job.view())
}

/// Deletes a transfer with all that belongs to it; what runs for it stops.
#[utoipa::path(delete, path = "/v1/transfers/{id}", operation_id = "delete_transfer", tag = "transfers", params(openapi::JobId), responses((status = 204, description = "It is gone")))]
pub(crate) async fn delete(
    State(service): State<Arc<Service>>,
    Requested(job): Requested<TransferJob>,
) -> Result<StatusCode, ApiError> {
    jobs::delete(&service, &job).await
}

/// Progress of the transfer: an event `progress` after each change, whose data is a `TransferProgress`, until the transfer is completed, failed or
/// deleted, or the service stops. Equal progress has equal event ids, so a client that reconnects with `Last-Event-ID` does not receive the last event
/// again.
#[utoipa::path(
    get, path = "/v1/transfers/{id}/events", operation_id = "get_transfer_events", tag = "transfers",
    params(openapi::JobId, ("Last-Event-ID" = Option<String>, Header, description = "Id of the last event received")),
    responses((status = 200, description = "Events whose data is JSON", content_type = "text/event-stream", body = Event)),
)]
pub(crate) async fn events(
    State(service): State<Arc<Service>>,
    RequestedJob { job, tenant }: RequestedJob<Transfer>,
    headers: HeaderMap,
) -> Result<Response, ApiError> {
    jobs::events(service, &tenant, job, &headers, |job, _| {
        let progress = job.progress();
        ProgressEvent::of(&progress, progress.state.is_final())
    })
}
