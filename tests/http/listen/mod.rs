//! The listener, met by clients that misbehave. Raw sockets, since well-made clients cannot be made to.

mod closing;
mod early;
mod heads;
mod shares;
mod slow;
mod tls;
#[cfg(target_os = "linux")]
mod vanished;

use axum::Router;
use axum::body::{Body, Bytes};
use axum::extract::ConnectInfo;
use axum::response::IntoResponse;
use axum::routing::{get, post};
use cager_service::http::listen::{Limits, is_body_timeout, serve};
use futures_util::StreamExt as _;
use http::{StatusCode, header};
use std::convert::Infallible;
use std::net::SocketAddr;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::{Duration, Instant};
use tokio::io::{AsyncRead, AsyncReadExt as _, AsyncWrite, AsyncWriteExt as _};
use tokio::net::{TcpListener, TcpStream};
use tokio::task::JoinHandle;
use tokio::time::timeout;
use tokio_util::sync::CancellationToken;

/// Longer than any limit under test; what takes this long hangs.
const HANG: Duration = Duration::from_secs(15);
/// Preface and empty settings of HTTP/2.
const HTTP2: &[u8] = b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n\x00\x00\x00\x04\x00\x00\x00\x00\x00";

fn ms(ms: u64) -> Duration {
    Duration::from_millis(ms)
}

/// Limits short enough for tests, none of them equal.
fn limits() -> Limits {
    Limits {
        header_timeout: ms(400),
        body_timeout: ms(500),
        idle_timeout: ms(700),
        write_timeout: ms(900),
        drain_timeout: ms(1200),
        max_connections: 64,
        spare_connections: 4,
        ..Limits::default()
    }
}

/// A running listener; stops when dropped.
struct Server {
    address: SocketAddr,
    stop: CancellationToken,
    running: JoinHandle<std::io::Result<()>>,
}

impl Drop for Server {
    fn drop(&mut self) {
        self.stop.cancel();
    }
}

fn app() -> Router {
    let endless = || futures_util::stream::repeat_with(|| Ok::<_, Infallible>(Bytes::from(vec![7; 64 << 10])));
    let ticking = || {
        let ticks = futures_util::stream::unfold((), |()| async {
            tokio::time::sleep(ms(50)).await;
            Some((Ok::<_, Infallible>(Bytes::from_static(b"tick\n")), ()))
        });
        Body::from_stream(ticks)
    };
    Router::new()
        .route("/", get(async || "here"))
        .route("/peer", get(async |ConnectInfo(peer): ConnectInfo<SocketAddr>| peer.to_string()))
        .route("/endless", get(async move || Body::from_stream(endless())))
        .route("/ticking", get(async move || ticking()))
        .route("/silent", get(async || Body::from_stream(futures_util::stream::pending::<Result<Bytes, Infallible>>())))
        .route("/slow", get(async || tokio::time::sleep(ms(2000)).await))
        .route("/count", post(count))
        .route("/lazy", post(lazy))
        .route(
            "/duplex",
            post(async move |body: Body| {
                tokio::spawn(count(body));
                Body::from_stream(endless())
            }),
        )
        .route("/stuck", post(stuck))
        .route("/refuse", post(async || (StatusCode::PAYLOAD_TOO_LARGE, "too large")))
}

/// Reads the whole body and says how long it was.
async fn count(body: Body) -> axum::response::Response {
    let mut stream = body.into_data_stream();
    let mut total = 0;
    while let Some(piece) = stream.next().await {
        match piece {
            Ok(piece) => total += piece.len(),
            Err(error) if is_body_timeout(&error) => return StatusCode::REQUEST_TIMEOUT.into_response(),
            Err(_) => return StatusCode::BAD_REQUEST.into_response(),
        }
    }
    total.to_string().into_response()
}

/// Lets the body wait for longer than the body timeout before it reads.
async fn lazy(body: Body) -> axum::response::Response {
    tokio::time::sleep(ms(1000)).await;
    count(body).await
}

/// How many requests of [`stuck`] are worked on.
static STUCK: AtomicUsize = AtomicUsize::new(0);

/// Reads one piece of the body and works on it for long, as on one that was packed well.
async fn stuck(body: Body) {
    struct Work;
    impl Drop for Work {
        fn drop(&mut self) {
            STUCK.fetch_sub(1, Ordering::SeqCst);
        }
    }
    let mut pieces = body.into_data_stream();
    pieces.next().await;
    STUCK.fetch_add(1, Ordering::SeqCst);
    let _work = Work;
    tokio::time::sleep(ms(60_000)).await;
    drop(pieces);
}

async fn start(limits: Limits) -> Server {
    start_with(limits, None).await
}

async fn start_with(limits: Limits, tls: Option<Arc<rustls::ServerConfig>>) -> Server {
    let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
    let address = listener.local_addr().unwrap();
    let stop = CancellationToken::new();
    let spare = Router::new()
        .route("/healthz", get(async || "ok"))
        .fallback(async || (StatusCode::SERVICE_UNAVAILABLE, [(header::RETRY_AFTER, "1")], "busy"));
    let running = tokio::spawn(serve(listener, app(), spare, limits, tls, stop.clone()));
    Server { address, stop, running }
}

impl Server {
    async fn connect(&self) -> TcpStream {
        TcpStream::connect(self.address).await.unwrap()
    }

    /// Stops it; gives the time until it had stopped.
    async fn stop(mut self) -> Duration {
        let began = Instant::now();
        self.stop.cancel();
        timeout(HANG, &mut self.running).await.expect("the server hangs").unwrap().unwrap();
        began.elapsed()
    }
}

/// Reads until the other side closes; gives what came.
async fn read_to_close(stream: &mut TcpStream) -> Vec<u8> {
    let mut bytes = Vec::new();
    // A reset is a way of closing, too.
    let _ = timeout(HANG, stream.read_to_end(&mut bytes)).await.expect("the connection stays open");
    bytes
}

/// A connection that has a place, and an answer: one that was given back a moment ago may be found free a little later.
async fn placed(server: &Server) -> TcpStream {
    let found = async {
        loop {
            let mut stream = server.connect().await;
            let sent = stream.write_all(b"GET / HTTP/1.1\r\nHost: x\r\n\r\n").await;
            if sent.is_ok() && read_response(&mut stream).await.ends_with("here") {
                return stream;
            }
            tokio::time::sleep(ms(20)).await;
        }
    };
    timeout(HANG, found).await.expect("no place becomes free")
}

/// Sends text and reads one response with a Content-Length.
async fn ask(stream: &mut (impl AsyncRead + AsyncWrite + Unpin), text: &str) -> String {
    stream.write_all(text.as_bytes()).await.unwrap();
    read_response(stream).await
}

async fn read_response(stream: &mut (impl AsyncRead + Unpin)) -> String {
    let mut bytes = Vec::new();
    let whole = async {
        loop {
            let text = String::from_utf8_lossy(&bytes).to_lowercase();
            if let Some((head, body)) = text.split_once("\r\n\r\n") {
                let length = head.lines().find_map(|line| line.strip_prefix("content-length: "));
                if body.len() >= length.map_or(0, |length| length.parse().unwrap()) {
                    return;
                }
            }
            // A reset is a way of closing, too.
            if stream.read_buf(&mut bytes).await.unwrap_or(0) == 0 {
                return;
            }
        }
    };
    timeout(HANG, whole).await.expect("no response");
    String::from_utf8_lossy(&bytes).into_owned()
}

/// `took` from before the server's clock starts, so that a test that comes to its turn late does not measure too little.
#[track_caller]
fn assert_took(took: Duration, limit: Duration) {
    // Clocks are looked at now and then, and tests share two processors.
    assert!(took + ms(60) >= limit && took < limit + ms(5000), "closed after {took:?}; the limit is {limit:?}");
}
