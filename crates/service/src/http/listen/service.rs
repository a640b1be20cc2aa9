//! Between protocol and router: refuses ambiguous or oversized headers and wraps the bodies.

use super::Limits;
use super::body::{RequestBody, ResponseBody};
use super::head::Head;
use super::state::{ConnectionHandle, State};
use crate::problem::{HEADER_TOO_LARGE, ProblemKind};
use axum::Router;
use axum::body::Body;
use axum::extract::ConnectInfo;
use cager_proto::messages::Problem;
use http::header::{CONNECTION, CONTENT_TYPE, HeaderValue, TRANSFER_ENCODING};
use http::{Request, Response, StatusCode, Version};
use hyper::body::Incoming;
use std::convert::Infallible;
use std::net::SocketAddr;
use std::pin::Pin;
use std::sync::Arc;
use std::sync::atomic::Ordering;
use tokio::sync::Notify;
use tower::Service as _;

/// The requests of one connection.
#[derive(Clone)]
pub(super) struct RequestService {
    pub(super) app: Router,
    pub(super) peer: SocketAddr,
    pub(super) limits: Arc<Limits>,
    pub(super) state: Arc<State>,
    /// Notified when the first request begins, on connections that serve only one.
    pub(super) only_one: Option<Arc<Notify>>,
}

impl hyper::service::Service<Request<Incoming>> for RequestService {
    type Response = Response<ResponseBody>;
    type Error = Infallible;
    type Future = Pin<Box<dyn Future<Output = Result<Self::Response, Infallible>> + Send>>;

    fn call(&self, request: Request<Incoming>) -> Self::Future {
        let (head, in_flight) = self.state.begin();
        if let Some(only_one) = &self.only_one {
            only_one.notify_one();
        }
        let this = self.clone();
        Box::pin(async move {
            let http2 = request.version() == Version::HTTP_2;
            let (response, close) = match refusal(&request, head, &this.limits) {
                Some(problem) => (problem, true),
                None => {
                    let mut request = request.map(|body| RequestBody::new(body, &in_flight, this.limits.body_timeout));
                    let unfinished = request.body().unfinished();
                    request.extensions_mut().insert(ConnectInfo(this.peer));
                    request.extensions_mut().insert(ConnectionHandle::of(&in_flight));
                    let Ok(response) = this.app.clone().call(request.map(Body::new)).await;
                    // The rest of the body would be parsed as the next request.
                    (response, unfinished.load(Ordering::Acquire))
                }
            };
            let mut response = response.map(|body| ResponseBody::new(body, in_flight, http2));
            if close && !http2 {
                response.headers_mut().insert(CONNECTION, HeaderValue::from_static("close"));
            }
            Ok(response)
        })
    }
}

/// The response to a request that must not reach the router.
fn refusal(request: &Request<Incoming>, head: Option<Head>, limits: &Limits) -> Option<Response<Body>> {
    let lengths = match head {
        Some(head) => head.ambiguous,
        // A pipelined header, which the scanner has not seen.
        None => request.version() != Version::HTTP_2 && request.headers().contains_key(TRANSFER_ENCODING),
    };
    if lengths {
        let detail = "Send either Content-Length or Transfer-Encoding, and a chunked request only after the response to the \
                      one before.";
        return Some(problem(
            StatusCode::BAD_REQUEST,
            "bad-request",
            "The request's length is ambiguous",
            detail,
            None,
        ));
    }
    let bytes = head.map_or(0, |head| head.bytes);
    if bytes > limits.max_header_bytes {
        let detail = format!("The header has {bytes} bytes; at most {} are allowed.", limits.max_header_bytes);
        return Some(too_large(&detail, limits.max_header_bytes));
    }
    let count = request.headers().len();
    if count > limits.max_headers {
        let detail = format!("The header has {count} lines; at most {} are allowed.", limits.max_headers);
        return Some(too_large(&detail, limits.max_headers));
    }
    None
}

fn too_large(detail: &str, limit: usize) -> Response<Body> {
    let ProblemKind { status, word, title } = HEADER_TOO_LARGE;
    problem(status, word, title, detail, Some(limit as u64))
}

fn problem(status: StatusCode, word: &str, title: &str, detail: &str, limit: Option<u64>) -> Response<Body> {
    let id = uuid::Uuid::now_v7().simple().to_string();
    tracing::info!(request_id = id, status = status.as_u16(), problem = word, "request refused before it was read");
    let problem = Problem {
        kind: format!("{}{word}", Problem::TYPE_PREFIX),
        title: title.to_owned(),
        status: status.as_u16(),
        detail: detail.to_owned(),
        limit,
        request_id: Some(id.clone()),
        ..Problem::default()
    };
    let mut response = Response::new(Body::from(serde_json::to_vec(&problem).unwrap_or_default()));
    *response.status_mut() = status;
    response.headers_mut().insert(CONTENT_TYPE, HeaderValue::from_static("application/problem+json"));
    if let Ok(id) = HeaderValue::try_from(id) {
        response.headers_mut().insert("x-request-id", id);
    }
    response
}
