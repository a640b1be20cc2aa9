//! `GET /v1/sessions/{id}/events`: progress as server-sent events.

use super::extract::RequestedSession;
use super::openapi;
use super::progress::{self, Event, ProgressEvent, ProgressSource};
use crate::problem::ApiError;
use crate::service::Service;
use axum::extract::State;
use axum::response::Response;
use cager_proto::messages::{Progress, SessionState};
use http::HeaderMap;
use std::sync::Arc;

/// Progress of the session: an event `progress` after each change, until the session is completed, failed or deleted, or the service stops.
/// Equal progress has equal event ids, so a client that reconnects with `Last-Event-ID` does not receive the last event again.
#[utoipa::path(
    get, path = "/v1/sessions/{id}/events", operation_id = "get_events", tag = "sessions",
    params(openapi::Id, ("Last-Event-ID" = Option<String>, Header, description = "Id of the last event received")),
    responses((status = 200, description = "Events whose data is JSON", content_type = "text/event-stream", body = Event)),
)]
pub(crate) async fn get(
    State(service): State<Arc<Service>>,
    RequestedSession { session, tenant }: RequestedSession,
    headers: HeaderMap,
) -> Result<Response, ApiError> {
    let place = service.stream(&tenant)?;
    let (changes, deleted) = (session.changes(), session.deleted().clone());
    let look = move |_: Option<&str>| {
        let progress = session.progress();
        ProgressEvent {
            id: id_of(&progress),
            data: serde_json::to_string(&progress).unwrap_or_default(),
            last: matches!(progress.state, SessionState::Completed | SessionState::Failed),
        }
    };
    Ok(progress::stream(service, place, &headers, ProgressSource { changes, deleted, look: Box::new(look) }))
}

fn id_of(progress: &Progress) -> String {
    let state = match progress.state {
        SessionState::Preparing => 'p',
        SessionState::Ready => 'r',
        SessionState::Completed => 'c',
        SessionState::Failed => 'f',
    };
    format!("{state}{}.{}", progress.received, progress.solved)
}
