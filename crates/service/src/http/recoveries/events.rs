//! `GET /v1/recoveries/{id}/events`: progress of a recovery as server-sent events.

use crate::http::extract::RequestedJob;
use crate::http::progress::Event;
use crate::http::progress::ProgressEvent;
use crate::http::{jobs, openapi};
use crate::problem::ApiError;
use crate::recovery::Recovery;
use crate::service::Service;
use axum::extract::State;
use axum::response::Response;
use http::HeaderMap;
use std::sync::Arc;

/// Progress of the recovery: an event `progress` after each change, whose data is a `RecoveryProgress` with the frames that were followed since the
/// event before, until the recovery is completed, failed or deleted, or the service stops. A client that reconnects with `Last-Event-ID` gets the frames
/// from there on.
#[utoipa::path(
    get, path = "/v1/recoveries/{id}/events", operation_id = "get_recovery_events", tag = "recoveries",
    params(openapi::JobId, ("Last-Event-ID" = Option<String>, Header, description = "Id of the last event received")),
    responses((status = 200, description = "Events whose data is JSON", content_type = "text/event-stream", body = Event)),
)]
pub(crate) async fn get(
    State(service): State<Arc<Service>>,
    RequestedJob { job, tenant }: RequestedJob<Recovery>,
    headers: HeaderMap,
) -> Result<Response, ApiError> {
    jobs::events(service, &tenant, job, &headers, |job, heard| {
        let told = heard.and_then(|id| id.split('.').next()?.parse().ok()).unwrap_or(0);
        let (progress, last) = job.progress_from(told);
        let up_to = progress.frames.last().map_or(told, |frame| frame.frame + 1);
        let state = serde_json::to_value(progress.state).unwrap_or_default();
        ProgressEvent {
            id: format!("{up_to}.{}.{}.{}", state.as_str().unwrap_or_default(), progress.received, progress.refined),
            data: serde_json::to_string(&progress).unwrap_or_default(),
            last,
        }
    })
}
