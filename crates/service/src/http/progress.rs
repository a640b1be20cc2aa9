//! Server-sent events that report progress.

use crate::admission::Permit;
use crate::service::Service;
use axum::body::Body;
use axum::response::{IntoResponse, Response};
use bytes::Bytes;
use http::{HeaderMap, header};
use serde::Serialize;
use std::io;
use std::sync::Arc;
use std::time::Duration;
use tokio::sync::watch;
use tokio_util::sync::CancellationToken;

/// A server-sent event.
#[derive(utoipa::ToSchema)]
#[allow(dead_code, reason = "it only describes")]
pub(crate) struct Event {
    /// `progress`; as the last one also `deleted`, or `stopping` where the service stops.
    event: Option<String>,
    /// Identifies its content, for `Last-Event-ID`.
    id: Option<String>,
    /// JSON: `{"state": …, "received": …, "solved": …}` with the state and the numbers of frames; `{}` for the other two types.
    data: Option<String>,
}

/// Shortest interval between events.
const MIN_EVENT_INTERVAL: Duration = Duration::from_millis(100);
/// Interval of comments that keep proxies from closing an idle connection.
const KEEP_ALIVE: Duration = Duration::from_secs(15);

/// The current state, for who was told the event with this id last.
pub(super) type Look = Box<dyn Fn(Option<&str>) -> ProgressEvent + Send + Sync>;

/// The source of progress events.
pub(super) struct ProgressSource {
    /// Notifies of changes.
    pub(super) changes: watch::Receiver<u64>,
    pub(super) deleted: CancellationToken,
    pub(super) look: Look,
}

/// An event.
pub(super) struct ProgressEvent {
    /// Event id; the same for the same data, so that a reconnecting client does not receive it again.
    pub(super) id: String,
    /// JSON.
    pub(super) data: String,
    /// Whether the state is final.
    pub(super) last: bool,
}

impl ProgressEvent {
    /// An event whose id is that of its data.
    pub(super) fn of(data: &impl Serialize, last: bool) -> Self {
        let data = serde_json::to_string(data).unwrap_or_default();
        Self { id: blake3::hash(data.as_bytes()).to_hex()[..16].to_owned(), data, last }
    }
}

/// Streams an event `progress` after each change, until the state is final, the object is deleted, or the service stops.
pub(super) fn stream(service: Arc<Service>, place: Permit, headers: &HeaderMap, followed: ProgressSource) -> Response {
    let heard = headers.get("last-event-id").and_then(|id| id.to_str().ok()).map(str::to_owned);
    let stream = futures_util::stream::unfold(Some((heard, followed, place)), move |state| {
        let service = Arc::clone(&service);
        async move {
            let (heard, mut followed, place) = state?;
            loop {
                followed.changes.mark_unchanged();
                if followed.deleted.is_cancelled() {
                    return Some((Ok(Bytes::from_static(b"event: deleted\ndata: {}\n\n")), None));
                }
                let ProgressEvent { id, last, .. } = (followed.look)(heard.as_deref());
                if heard.as_deref() != Some(id.as_str()) {
                    if heard.is_some() {
                        tokio::time::sleep(MIN_EVENT_INTERVAL).await;
                    }
                    let ProgressEvent { id, data, last } = (followed.look)(heard.as_deref());
                    let event = format!("event: progress\nid: {id}\ndata: {data}\n\n");
                    let rest = (!last).then_some((Some(id), followed, place));
                    return Some((Ok::<_, io::Error>(Bytes::from(event)), rest));
                }
                if last {
                    return None;
                }
                tokio::select! {
                    _ = followed.changes.changed() => {}
                    () = followed.deleted.cancelled() => {}
                    () = service.stopping().cancelled() => {
                        return Some((Ok(Bytes::from_static(b"event: stopping\ndata: {}\n\n")), None));
                    }
                    () = tokio::time::sleep(KEEP_ALIVE) => {
                        return Some((Ok(Bytes::from_static(b": still here\n\n")), Some((heard, followed, place))));
                    }
                }
            }
        }
    });
    let response_headers = [(header::CONTENT_TYPE, "text/event-stream"), (header::CACHE_CONTROL, "no-store")];
    (response_headers, Body::from_stream(stream)).into_response()
}
