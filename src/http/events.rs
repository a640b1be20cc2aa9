//! `GET /v1/sessions/{id}/events`: progress as server-sent events.

use super::extract::Found;
use super::openapi;
use super::progress::{self, Followed, Standing};
use crate::problem::ApiError;
use crate::service::Service;
use axum::extract::State;
use axum::response::Response;
use cager_proto::messages::{Progress, SessionState};
use http::HeaderMap;
use std::sync::Arc;

/// A server-sent event.
#[derive(utoipa::ToSchema)]
#[allow(dead_code, reason = "it only describes")]
pub(crate) struct Event {
    /// `progress`; as the last one also `deleted`, or `stopping` where the service stops.
    event: Option<String>,
    /// What it tells, for `Last-Event-ID`.
    id: Option<String>,
    /// JSON: `{"state": …, "received": …, "solved": …}` with the state and the frames of the session; `{}` of the two others.
    data: Option<String>,
}

/// Progress of the session: an event `progress` with each change, until it is completed, failed or deleted, or the service stops. An event's id says what it tells, so
/// that `Last-Event-ID` keeps a client that comes back from hearing the same again.
#[utoipa::path(
    get, path = "/v1/sessions/{id}/events", operation_id = "get_events", tag = "sessions",
    params(openapi::Id, ("Last-Event-ID" = Option<String>, Header, description = "The last event heard")),
    responses((status = 200, description = "Events whose data is JSON", content_type = "text/event-stream", body = Event)),
)]
pub(crate) async fn get(
    State(service): State<Arc<Service>>,
    Found { session, tenant }: Found,
    headers: HeaderMap,
) -> Result<Response, ApiError> {
    let place = service.stream(&tenant)?;
    let (changes, deleted) = (session.changes(), session.deleted().clone());
    let look = move || {
        let progress = session.progress();
        Standing {
            id: id_of(&progress),
            data: serde_json::to_string(&progress).unwrap_or_default(),
            last: matches!(progress.state, SessionState::Completed | SessionState::Failed),
        }
    };
    Ok(progress::stream(service, place, &headers, Followed { changes, deleted, look: Box::new(look) }))
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
