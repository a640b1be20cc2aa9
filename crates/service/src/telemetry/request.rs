//! Request identifiers, request spans and the access log.
//!
//! Only method, path and outcome are logged, never queries, headers or bodies: they may contain tokens and captures.

use super::traces;
use axum::body::Body;
use axum::extract::{ConnectInfo, Request};
use axum::middleware::Next;
use axum::response::Response;
use bytes::Bytes;
use http::{HeaderName, HeaderValue, StatusCode};
use http_body::{Body as HttpBody, Frame, SizeHint};
use opentelemetry::trace::FutureExt as _;
use std::net::SocketAddr;
use std::pin::Pin;
use std::sync::Arc;
use std::task::{Context, Poll, ready};
use std::time::{Duration, Instant};
use tracing::field::Empty;
use tracing::{Instrument as _, Span};

const HEADER: HeaderName = HeaderName::from_static("x-request-id");
/// Paths polled by probes; logged at debug level.
const PROBE_PATHS: [&str; 3] = ["/healthz", "/readyz", "/metrics"];
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
    let quiet = PROBE_PATHS.contains(&path);
    // Paths are percent-encoded ASCII, so that any byte is a boundary; `get` is for those that are not.
    let path = path.get(..PATH_BYTES).unwrap_or(path);
    let method = request.method();
    let span = if quiet {
        tracing::debug_span!("request", request_id = %id, %method, path, peer = Empty, tenant = Empty, token = Empty, problem = Empty, trace_id = Empty)
    } else {
        tracing::info_span!("request", request_id = %id, %method, path, peer = Empty, tenant = Empty, token = Empty, problem = Empty, trace_id = Empty)
    };
    if let Some(ConnectInfo(peer)) = request.extensions().get::<ConnectInfo<SocketAddr>>() {
        span.record("peer", tracing::field::display(peer));
    }
    let trace = traces::request(&request);
    if let Some(id) = traces::trace_id(&trace) {
        span.record("trace_id", id);
    }
    let mut log =
        Log { trace: trace.clone(), span: span.clone(), began: Instant::now(), quiet, answered: None, ended: false };
    let header = HeaderValue::from_str(&id.0);
    request.extensions_mut().insert(id);
    let mut response = next.run(request).with_context(trace).instrument(span).await;
    if let Ok(header) = header {
        response.headers_mut().insert(HEADER, header);
    }
    log.answered = Some((response.status(), log.began.elapsed()));
    let declared =
        response.headers().get(http::header::CONTENT_LENGTH).and_then(|value| value.to_str().ok()?.parse().ok());
    response.map(|inner| Body::new(Logged { ended: inner.is_end_stream(), inner, declared, given: 0, log }))
}

/// Logs the request when it is dropped: at the end of the response, or when the client disconnects.
struct Log {
    trace: opentelemetry::Context,
    span: Span,
    began: Instant,
    quiet: bool,
    /// Status, and time until it was known.
    answered: Option<(StatusCode, Duration)>,
    /// Whether the response was sent completely.
    ended: bool,
}

impl Drop for Log {
    fn drop(&mut self) {
        traces::ended(&self.trace, self.answered.map(|(status, _)| status));
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

/// A response body that owns the request's log entry.
struct Logged {
    inner: Body,
    ended: bool,
    /// Its length, after which nobody asks for the end.
    declared: Option<u64>,
    given: u64,
    log: Log,
}

impl HttpBody for Logged {
    type Data = Bytes;
    type Error = axum::Error;

    fn poll_frame(mut self: Pin<&mut Self>, cx: &mut Context<'_>) -> Poll<Option<Result<Frame<Bytes>, axum::Error>>> {
        let this = &mut *self;
        let frame = ready!(Pin::new(&mut this.inner).poll_frame(cx));
        if let Some(Ok(Some(data))) = frame.as_ref().map(|frame| frame.as_ref().map(Frame::data_ref)) {
            this.given += data.len() as u64;
        }
        this.ended = frame.is_none() || this.inner.is_end_stream() || this.declared == Some(this.given);
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

#[cfg(test)]
mod tests {
    use super::*;
    use axum::Router;
    use axum::routing::{get, post};
    use std::io::Write;
    use std::sync::Mutex;
    use tower::ServiceExt as _;
    use tracing_subscriber::EnvFilter;
    use tracing_subscriber::fmt::MakeWriter;

    /// Log lines, kept.
    #[derive(Clone, Default)]
    struct Lines(Arc<Mutex<Vec<u8>>>);

    impl Write for Lines {
        fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
            self.0.lock().unwrap().write(bytes)
        }
        fn flush(&mut self) -> std::io::Result<()> {
            Ok(())
        }
    }

    impl MakeWriter<'_> for Lines {
        type Writer = Self;
        fn make_writer(&self) -> Self {
            self.clone()
        }
    }

    fn app() -> Router {
        Router::new()
            .route("/id", get(async |request: Request| request.extensions().get::<RequestId>().unwrap().to_string()))
            .route("/echo", post(async |body: String| body))
            .route("/fail", get(async || StatusCode::SERVICE_UNAVAILABLE))
            .route("/healthz", get(async || "ok"))
            .route("/never", get(std::future::pending::<()>))
            .layer(axum::middleware::from_fn(request_id))
    }

    /// Sends a request; gives its identifier, its body and what was logged.
    async fn send(request: Request, filter: &str) -> (String, String, String) {
        let lines = Lines::default();
        let subscriber = tracing_subscriber::fmt()
            .with_env_filter(EnvFilter::new(filter))
            .with_writer(lines.clone())
            .json()
            .flatten_event(true)
            .with_span_list(false);
        let _guard = tracing::subscriber::set_default(subscriber.finish());
        let response = app().oneshot(request).await.unwrap();
        let id = response.headers()[HEADER].to_str().unwrap().to_owned();
        let body = axum::body::to_bytes(response.into_body(), 1 << 20).await.unwrap();
        let text = String::from_utf8(lines.0.lock().unwrap().clone()).unwrap();
        (id, String::from_utf8(body.to_vec()).unwrap(), text)
    }

    fn request(method: &str, path: &str) -> http::request::Builder {
        Request::builder().method(method).uri(path)
    }

    #[tokio::test]
    async fn identifiers_are_kept_if_they_can_stand_in_a_log() {
        for id in ["a", "A-1_b.c", &"x".repeat(64)] {
            let asked = request("GET", "/id").header("X-Request-Id", id).body(Body::empty()).unwrap();
            let (answered, body, _) = send(asked, "info").await;
            assert_eq!((answered.as_str(), body.as_str()), (id, id));
        }
        for id in ["", "a b", "a\tb", "é", &"x".repeat(65), "{\"a\":1}"] {
            let asked = request("GET", "/id").header("X-Request-Id", id).body(Body::empty()).unwrap();
            let (answered, body, _) = send(asked, "info").await;
            assert!(answered != id && answered.len() == 32 && answered == body, "{id:?}: {answered}");
        }
    }

    #[tokio::test]
    async fn neither_tokens_nor_queries_nor_bodies_are_logged() {
        let asked = request("POST", "/echo?token=in-the-query")
            .header("Authorization", "Bearer in-the-header")
            .header("Cookie", "in-the-cookie")
            .header("X-Request-Id", "seen")
            .body(Body::from("in-the-body"))
            .unwrap();
        let (_, body, log) = send(asked, "trace").await;
        assert_eq!(body, "in-the-body");
        assert!(!log.contains("in-the-") && !log.contains("Bearer"), "{log}");
        assert!(log.contains("\"request_id\":\"seen\"") && log.contains("\"path\":\"/echo\""), "{log}");
        assert!(log.contains("\"method\":\"POST\"") && log.contains("\"status\":200"), "{log}");
        assert!(log.contains("\"latency_ms\":") && log.contains("\"whole\":true"), "{log}");
    }

    #[tokio::test]
    async fn levels_follow_what_matters() {
        let of = async |path: &str, filter: &str| {
            let (_, _, log) = send(request("GET", path).body(Body::empty()).unwrap(), filter).await;
            log
        };
        assert!(of("/fail", "warn").await.contains("\"level\":\"WARN\""));
        assert!(of("/id", "warn").await.is_empty());
        assert!(of("/id", "info").await.contains("\"level\":\"INFO\""));
        assert!(of("/healthz", "info").await.is_empty());
        assert!(of("/healthz", "debug").await.contains("\"level\":\"DEBUG\""));
    }

    #[tokio::test]
    async fn a_client_that_has_gone_is_logged() {
        let lines = Lines::default();
        let subscriber = tracing_subscriber::fmt().with_writer(lines.clone()).finish();
        let _guard = tracing::subscriber::set_default(subscriber);
        let asked = app().oneshot(request("GET", "/never").body(Body::empty()).unwrap());
        assert!(tokio::time::timeout(Duration::from_millis(50), asked).await.is_err());
        let text = String::from_utf8(lines.0.lock().unwrap().clone()).unwrap();
        assert!(text.contains("client gone before the response"), "{text}");
    }
}
