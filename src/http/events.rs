//! `GET /v1/sessions/{id}/events`: progress as server-sent events.

use super::extract::Found;
use super::openapi;
use crate::problem::ApiError;
use crate::service::Service;
use axum::body::Body;
use axum::extract::State;
use axum::response::{IntoResponse, Response};
use bytes::Bytes;
use cager_proto::messages::{Progress, SessionState};
use http::{HeaderMap, header};
use std::io;
use std::sync::Arc;
use std::time::Duration;

/// Changes closer together than this are one event.
const AT_MOST_EVERY: Duration = Duration::from_millis(100);
/// Without changes, a comment keeps proxies from closing the connection.
const KEEP_ALIVE: Duration = Duration::from_secs(15);

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
    let heard = headers.get("last-event-id").and_then(|id| id.to_str().ok()).map(str::to_owned);
    let changes = session.changes();
    let stream = futures_util::stream::unfold(Some((heard, changes, place)), move |state| {
        let (service, session) = (Arc::clone(&service), Arc::clone(&session));
        async move {
            let (heard, mut changes, place) = state?;
            loop {
                changes.mark_unchanged();
                if session.is_deleted() {
                    return Some((Ok(Bytes::from_static(b"event: deleted\ndata: {}\n\n")), None));
                }
                let progress = session.progress();
                let last = matches!(progress.state, SessionState::Completed | SessionState::Failed);
                let id = id_of(&progress);
                if heard.as_deref() != Some(id.as_str()) {
                    if heard.is_some() {
                        tokio::time::sleep(AT_MOST_EVERY).await;
                    }
                    let progress = session.progress();
                    let (event, id) = (event(&progress), id_of(&progress));
                    let rest = (!last).then_some((Some(id), changes, place));
                    return Some((event, rest));
                }
                if last {
                    return None;
                }
                tokio::select! {
                    _ = changes.changed() => {}
                    () = session.deleted().cancelled() => {}
                    () = service.stopping().cancelled() => {
                        return Some((Ok(Bytes::from_static(b"event: stopping\ndata: {}\n\n")), None));
                    }
                    () = tokio::time::sleep(KEEP_ALIVE) => {
                        return Some((Ok(Bytes::from_static(b": still here\n\n")), Some((heard, changes, place))));
                    }
                }
            }
        }
    });
    let response_headers = [(header::CONTENT_TYPE, "text/event-stream"), (header::CACHE_CONTROL, "no-store")];
    Ok((response_headers, Body::from_stream(stream)).into_response())
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

fn event(progress: &Progress) -> io::Result<Bytes> {
    let data = serde_json::to_string(progress)?;
    Ok(format!("event: progress\nid: {}\ndata: {data}\n\n", id_of(progress)).into())
}
