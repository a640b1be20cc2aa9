//! Every request has an identifier, a span and one line in the log.
//!
//! Only method, path and outcome are logged. Queries, headers and bodies never are: they may hold tokens and captures.

use axum::body::Body;
use axum::extract::Request;
use axum::middleware::Next;
use axum::response::Response;
use bytes::Bytes;
use http::{HeaderName, HeaderValue, StatusCode};
use http_body::{Body as HttpBody, Frame, SizeHint};
use std::pin::Pin;
use std::sync::Arc;
use std::task::{Context, Poll, ready};
use std::time::{Duration, Instant};
use tracing::{Instrument as _, Span};

const HEADER: HeaderName = HeaderName::from_static("x-request-id");
/// Asked for every few seconds by machines.
const QUIET: [&str; 3] = ["/healthz", "/readyz", "/metrics"];
/// Longest part of a path that is logged.
const PATH_BYTES: usize = 256;

/// Identifier of a request, among its extensions; also in the response's `x-request-id` and in the log.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RequestId(pub Arc<str>);

impl RequestId {
    /// The client's identifier, if it is one that can stand in a log, or a fresh one.
    fn of(request: &Request) -> Self {
        let given = request.headers().get(HEADER).and_then(|value| value.to_str().ok());
        let fits = |text: &&str| {
            (1..=64).contains(&text.len())
                && text.bytes().all(|byte| byte.is_ascii_alphanumeric() || b"._-".contains(&byte))
        };
        Self(given.filter(fits).map_or_else(|| uuid::Uuid::now_v7().simple().to_string().into(), Into::into))
    }
}

impl std::fmt::Display for RequestId {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&self.0)
    }
}

/// Middleware that gives a request its identifier and logs it when its response has ended.
pub async fn request_id(mut request: Request, next: Next) -> Response {
    let id = RequestId::of(&request);
    let path = request.uri().path();
    let quiet = QUIET.contains(&path);
    // Paths are percent-encoded ASCII, so that any byte is a boundary; `get` is for those that are not.
    let path = path.get(..PATH_BYTES).unwrap_or(path);
    let method = request.method();
    let span = if quiet {
        tracing::debug_span!("request", request_id = %id, %method, path)
    } else {
        tracing::info_span!("request", request_id = %id, %method, path)
    };
    let mut log = Log { span: span.clone(), began: Instant::now(), quiet, answered: None, ended: false };
    let header = HeaderValue::from_str(&id.0);
    request.extensions_mut().insert(id);
    let mut response = next.run(request).instrument(span).await;
    if let Ok(header) = header {
        response.headers_mut().insert(HEADER, header);
    }
    log.answered = Some((response.status(), log.began.elapsed()));
    response.map(|inner| Body::new(Logged { ended: inner.is_end_stream(), inner, log }))
}

/// Writes the request's line when it is dropped: at the end of the response, or when the client has gone.
struct Log {
    span: Span,
    began: Instant,
    quiet: bool,
    /// Status, and time until it was known.
    answered: Option<(StatusCode, Duration)>,
    /// The response was given to its end.
    ended: bool,
}

impl Drop for Log {
    fn drop(&mut self) {
        let total_ms = self.began.elapsed().as_secs_f64() * 1e3;
        let _entered = self.span.enter();
        let Some((status, latency)) = self.answered else {
            tracing::info!(total_ms, "client gone before the response");
            return;
        };
        let (code, latency_ms, whole) = (status.as_u16(), latency.as_secs_f64() * 1e3, self.ended);
        if status.is_server_error() {
            tracing::warn!(status = code, latency_ms, total_ms, whole, "request failed");
        } else if self.quiet {
            tracing::debug!(status = code, latency_ms, total_ms, whole, "request");
        } else {
            tracing::info!(status = code, latency_ms, total_ms, whole, "request");
        }
    }
}

/// A response body that takes the request's log line along.
struct Logged {
    inner: Body,
    ended: bool,
    log: Log,
}

impl HttpBody for Logged {
    type Data = Bytes;
    type Error = axum::Error;

    fn poll_frame(mut self: Pin<&mut Self>, cx: &mut Context<'_>) -> Poll<Option<Result<Frame<Bytes>, axum::Error>>> {
        let this = &mut *self;
        let frame = ready!(Pin::new(&mut this.inner).poll_frame(cx));
        this.ended = frame.is_none() || this.inner.is_end_stream();
        Poll::Ready(frame)
    }

    fn is_end_stream(&self) -> bool {
        self.inner.is_end_stream()
    }

    fn size_hint(&self) -> SizeHint {
        self.inner.size_hint()
    }
}

impl Drop for Logged {
    fn drop(&mut self) {
        self.log.ended = self.ended;
    }
}
