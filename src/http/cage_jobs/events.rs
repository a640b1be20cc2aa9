//! `GET /v1/cages/{id}/events`: progress of a design as server-sent events.

use crate::cage_job::CageDesign;
use crate::http::events::Event;
use crate::http::extract::RequestedJob;
use crate::http::openapi;
use crate::http::progress::{self, ProgressEvent, ProgressSource};
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
    params(openapi::CageId, ("Last-Event-ID" = Option<String>, Header, description = "Id of the last event received")),
    responses((status = 200, description = "Events whose data is JSON", content_type = "text/event-stream", body = Event)),
)]
pub(crate) async fn get(
    State(service): State<Arc<Service>>,
    RequestedJob { job, tenant }: RequestedJob<CageDesign>,
    headers: HeaderMap,
) -> Result<Response, ApiError> {
    let place = service.stream(&tenant)?;
    let (changes, deleted) = (job.changes(), job.deleted().clone());
    let look = move |_: Option<&str>| {
        let progress = job.progress();
        let data = serde_json::to_string(&progress).unwrap_or_default();
        let id = blake3::hash(data.as_bytes()).to_hex()[..16].to_owned();
        ProgressEvent { id, data, last: progress.state.is_final() }
    };
    Ok(progress::stream(service, place, &headers, ProgressSource { changes, deleted, look: Box::new(look) }))
}
