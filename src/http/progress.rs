//! Streams of server-sent events that tell where something stands.

use crate::admission::Held;
use crate::service::Service;
use axum::body::Body;
use axum::response::{IntoResponse, Response};
use bytes::Bytes;
use http::{HeaderMap, header};
use std::io;
use std::sync::Arc;
use std::time::Duration;
use tokio::sync::watch;
use tokio_util::sync::CancellationToken;

/// Changes closer together than this are one event.
const AT_MOST_EVERY: Duration = Duration::from_millis(100);
/// Without changes, a comment keeps proxies from closing the connection.
const KEEP_ALIVE: Duration = Duration::from_secs(15);

/// What is followed.
pub(super) struct Followed {
    /// Changes whenever something does.
    pub(super) changes: watch::Receiver<u64>,
    pub(super) deleted: CancellationToken,
    /// Where it stands.
    pub(super) look: Box<dyn Fn() -> Standing + Send + Sync>,
}

/// Where something stands.
pub(super) struct Standing {
    /// Says what is told, so that it is not told again to who knows it.
    pub(super) id: String,
    /// JSON.
    pub(super) data: String,
    /// Whether nothing changes any more.
    pub(super) last: bool,
}

/// An event `progress` with each change, until nothing changes any more, it is deleted, or the service stops.
pub(super) fn stream(service: Arc<Service>, place: Held, headers: &HeaderMap, followed: Followed) -> Response {
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
                let Standing { id, last, .. } = (followed.look)();
                if heard.as_deref() != Some(id.as_str()) {
                    if heard.is_some() {
                        tokio::time::sleep(AT_MOST_EVERY).await;
                    }
                    let Standing { id, data, .. } = (followed.look)();
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
