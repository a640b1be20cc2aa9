//! Requests that another process answers.

use crate::admission::{Budget, Exhausted, Permit};
use crate::http::{only_reads, until};
use crate::problem::{self, ApiError};
use crate::sync::lock;
use axum::body::Body;
use axum::extract::Request;
use axum::response::Response;
use cager_store::Membership;
use futures_util::future::{BoxFuture, FutureExt, Shared};
use futures_util::stream;
use http::header::{
    CONNECTION, CONTENT_LENGTH, CONTENT_TYPE, HOST, HeaderName, PROXY_AUTHENTICATE, PROXY_AUTHORIZATION, TE, TRAILER,
    TRANSFER_ENCODING, UPGRADE,
};
use http::{HeaderMap, HeaderValue};
use http_body_util::BodyExt;
use std::sync::{Arc, Mutex};
use std::time::Duration;
use tokio::sync::watch;
use tokio::time::sleep;
use tokio_util::sync::CancellationToken;

/// How often a request has been sent on.
const HOPS: HeaderName = HeaderName::from_static("cager-hops");
/// How often it may be: while a shard moves, its last process sends requests to the next one.
const MOST_HOPS: u32 = 3;
/// How long connecting may take.
const CONNECT: Duration = Duration::from_secs(2);
/// How long a request may go on elsewhere, once this process has given up its shards.
const AFTER_END: Duration = Duration::from_secs(2);
/// Memory of a response that passes through and that nobody reads: the connections' buffers on both sides.
const PASSING_BYTES: u64 = 512 << 10;
/// That of one whose length is not known, most of which are read as they come; the tenant's streams bound their number.
const STREAM_BYTES: u64 = 256 << 10;
/// Smaller responses are in the connection's buffers at once.
const SMALL_BYTES: u64 = 16 << 10;
/// Headers of one connection.
const OF_CONNECTION: [HeaderName; 8] = [
    CONNECTION,
    PROXY_AUTHENTICATE,
    PROXY_AUTHORIZATION,
    TE,
    TRAILER,
    TRANSFER_ENCODING,
    UPGRADE,
    HeaderName::from_static("keep-alive"),
];

/// What became of a request that was sent on.
pub(super) enum Sent {
    /// The other process's response.
    Answered(Response),
    /// The other process has taken nothing of it.
    NotTaken(Request),
    /// There is no response, and why: `lost` where the other process has taken it and is gone.
    Refused(ApiError, &'static str),
}

/// A moment after this process has given up all it had.
pub(super) type GivenUp = Shared<BoxFuture<'static, ()>>;

/// What is asked until then is still answered; a request that is sent again has no more time.
pub(super) fn given_up(ended: CancellationToken) -> GivenUp {
    let moment = async move {
        ended.cancelled().await;
        sleep(AFTER_END).await;
    };
    moment.boxed().shared()
}

/// For how long a request may go on elsewhere, and what its response may take here.
pub(super) struct Going {
    /// Who lives.
    pub(super) seen: watch::Receiver<Membership>,
    /// This process ends.
    pub(super) given_up: GivenUp,
    /// Memory of responses, and whose this one is.
    pub(super) room: (Arc<Budget>, String),
}

impl Going {
    /// Ends when the process at `address` has ended, or this one has given up all it had.
    async fn over(mut seen: watch::Receiver<Membership>, given_up: GivenUp, address: String) {
        let is_gone = |seen: &Membership| !seen.processes.values().any(|known| *known == address);
        tokio::select! {
            // An error means that this process ends.
            _ = seen.wait_for(is_gone) => {}
            () = given_up => {}
        }
    }

    /// Memory for a response: the process that works has none of it any more where it was sent.
    fn room_for(&self, response: &http::Response<reqwest::Body>) -> Result<Option<Permit>, Exhausted> {
        let told = |name| response.headers().get(name).and_then(|value: &HeaderValue| value.to_str().ok());
        let is_quiet = told(CONTENT_TYPE).is_some_and(|kind| kind.starts_with("text/event-stream"));
        let bytes = http_body::Body::size_hint(response.body()).exact().unwrap_or(STREAM_BYTES).min(PASSING_BYTES);
        if is_quiet || bytes <= SMALL_BYTES {
            return Ok(None);
        }
        let (memory, tenant) = &self.room;
        memory.try_take(tenant, bytes).map(Some)
    }
}

/// Sends requests to other processes.
pub(super) struct Forwarder {
    client: reqwest::Client,
    /// With a connection for each request: for bodies of unknown length, which the other process takes on connections alone on which all before is over, and
    /// that it knows later than the one that sends.
    fresh: reqwest::Client,
}

impl Forwarder {
    /// `is_tls` where the processes are asked over TLS, by the authorities that this machine trusts. They close connections that stay `idle` for longer.
    ///
    /// # Errors
    /// What the library says.
    pub(super) fn new(is_tls: bool, idle: Duration) -> Result<Self, reqwest::Error> {
        let _ = rustls::crypto::ring::default_provider().install_default();
        let builder = || {
            let builder = reqwest::Client::builder().no_proxy().http1_only().connect_timeout(CONNECT);
            let builder = if is_tls { builder } else { builder.tls_certs_only([]) };
            builder.redirect(reqwest::redirect::Policy::none())
        };
        let client = builder().pool_idle_timeout(idle / 2).build()?;
        Ok(Self { client, fresh: builder().pool_max_idle_per_host(0).build()? })
    }

    /// Sends a request to the process at `address`.
    pub(super) async fn send(&self, request: Request, address: &str, going: Going) -> Sent {
        let only_reads = only_reads(&request);
        let (parts, body) = request.into_parts();
        let hops = parts.headers.get(HOPS).and_then(|hops| hops.to_str().ok()?.parse().ok()).unwrap_or(0u32);
        if hops >= MOST_HOPS {
            let detail = "the sessions of this tenant are moving between processes; try again";
            return Sent::Refused(ApiError::new(problem::BUSY, detail).retry_after(1), "no_holder");
        }
        let path = parts.uri.path_and_query().map_or("/", |path| path.as_str());
        let mut headers = end_to_end(&parts.headers);
        headers.insert(HOPS, HeaderValue::from(hops + 1));
        // In HTTP/2 it is part of the address.
        let authority = parts.uri.authority().and_then(|host| HeaderValue::from_str(host.as_str()).ok());
        if let Some(host) = authority {
            headers.insert(HOST, host);
        }
        let has_body = !http_body::Body::is_end_stream(&body);
        let body = Arc::new(Mutex::new(Some(body)));
        let client = if has_body && !headers.contains_key(CONTENT_LENGTH) { &self.fresh } else { &self.client };
        let mut sent = client.request(parts.method.clone(), format!("{address}{path}")).headers(headers);
        if has_body {
            sent = sent.body(reqwest::Body::wrap_stream(taken_when_read(Arc::clone(&body))));
        }
        let mut over = Box::pin(Going::over(going.seen.clone(), going.given_up.clone(), address.to_owned()));
        let answered = tokio::select! {
            answered = sent.send() => answered,
            () = &mut over => return unanswered(parts, &body, has_body, "one of the two has ended"),
        };
        match answered {
            Ok(response) => {
                metrics::counter!("cager_forwarded_total").increment(1);
                let response = http::Response::<reqwest::Body>::from(response);
                let room = match going.room_for(&response) {
                    // What has been done is not refused.
                    Err(full) if only_reads => {
                        return Sent::Refused(full.refusal("memory for downloads"), "download_memory");
                    }
                    room => room.unwrap_or_default(),
                };
                let (mut head, body) = response.into_parts();
                head.headers = end_to_end(&head.headers);
                Sent::Answered(Response::from_parts(head, until(Body::new(body), over, room)))
            }
            Err(error) => {
                tracing::warn!(address, %error, "another process does not answer");
                // Of a request without a body it is not known whether it was seen.
                unanswered(parts, &body, has_body || error.is_connect(), "it does not answer")
            }
        }
    }
}

/// The request, where it can be sent again: nothing was read of its body, if that says whether it was `seen_by_body`, or it changes nothing.
fn unanswered(parts: http::request::Parts, body: &Mutex<Option<Body>>, seen_by_body: bool, why: &str) -> Sent {
    match lock(body).take() {
        Some(body) if seen_by_body || parts.method.is_safe() => Sent::NotTaken(Request::from_parts(parts, body)),
        _ => Sent::Refused(ended(why), "lost"),
    }
}

fn ended(why: &str) -> ApiError {
    let detail = format!("the process that has this tenant's sessions was asked, and {why}; send the request again");
    ApiError::new(problem::BUSY, detail).retry_after(1)
}

/// A body that stays where it is until its first byte is wanted.
fn taken_when_read(
    body: Arc<Mutex<Option<Body>>>,
) -> impl futures_util::Stream<Item = Result<bytes::Bytes, axum::Error>> + Send + 'static {
    stream::unfold((body, None::<Body>), |(kept, reading)| async move {
        let mut reading = match reading {
            Some(reading) => reading,
            None => lock(&kept).take()?,
        };
        loop {
            match reading.frame().await? {
                Ok(frame) => {
                    if let Ok(data) = frame.into_data() {
                        return Some((Ok(data), (kept, Some(reading))));
                    }
                }
                Err(error) => return Some((Err(error), (kept, Some(reading)))),
            }
        }
    })
}

/// Headers without those of the connection, and those that these name.
fn end_to_end(headers: &HeaderMap) -> HeaderMap {
    let mut kept = headers.clone();
    for named in headers.get_all(CONNECTION).iter().filter_map(|value| value.to_str().ok()) {
        for name in named.split(',') {
            kept.remove(name.trim());
        }
    }
    for name in OF_CONNECTION {
        kept.remove(name);
    }
    kept
}
