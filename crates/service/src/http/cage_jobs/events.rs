//! `GET /v1/cages/{id}/events`: progress of a design as server-sent events.

use crate::cage_job::CageDesign;
use crate::http::extract::RequestedJob;
use crate::http::progress::Event;
use crate::http::progress::ProgressEvent;
use crate::http::{jobs, openapi};
use crate::problem::ApiError;
use crate::service::Service;
use axum::extract::State;
use axum::response::Response;
use http::HeaderMap;
use std::sync::Arc;

/// Progress of the design: an event `progress` after each change, whose data is a `CageProgress`, until the design is completed, failed or
/// deleted, or the service stops. Equal progress has equal event ids, so a client that reconnects with `Last-Event-ID` does not receive the
/// last event again.
#[utoipa::path(
    get, path = "/v1/cages/{id}/events", operation_id = "get_cage_events", tag = "cages",
    params(openapi::JobId, ("Last-Event-ID" = Option<String>, Header, description = "Id of the last event received")),
    responses((status = 200, description = "Events whose data is JSON", content_type = "text/event-stream", body = Event)),
)]
pub(crate) async fn get(
    State(service): State<Arc<Service>>,
    RequestedJob { job, tenant }: RequestedJob<CageDesign>,
    headers: HeaderMap,
) -> Result<Response, ApiError> {
    jobs::events(service, &tenant, job, &headers, |job, _| {
        let progress = job.progress();
        ProgressEvent::of(&progress, progress.state.is_final())
    })
}
