//! Serving one connection.

use super::Limits;
use super::idle::{IdleConnections, IdleEntry};
use super::service::RequestService;
use super::shared_stream::SharedStream;
use super::socket::{ConnectionResources, Socket};
use super::state::{Reason, State};
use axum::Router;
use hyper_util::rt::{TokioExecutor, TokioIo, TokioTimer};
use hyper_util::server::conn::auto::Builder;
use std::net::SocketAddr;
use std::sync::Arc;
use std::time::Duration;
use tokio::io::{AsyncRead, AsyncWrite};
use tokio::net::TcpStream;
use tokio::sync::Notify;
use tokio::time::{Instant, MissedTickBehavior, interval, timeout};
use tokio_rustls::TlsAcceptor;
use tokio_util::sync::CancellationToken;

/// How long closing a connection without requests may take.
const CLOSE_TIMEOUT: Duration = Duration::from_secs(1);
/// Limit of HTTP/1.1 buffers per connection and direction, in bytes; also bounds endless headers.
const BUFFER_BYTES: usize = 128 << 10;
/// Interval of HTTP/2 pings, and the time to answer them.
const PING: Duration = Duration::from_secs(20);

/// What all connections share.
pub(super) struct Shared {
    pub(super) app: Router,
    pub(super) spare: Router,
    pub(super) limits: Arc<Limits>,
    pub(super) tls: Option<TlsAcceptor>,
    pub(super) stop: CancellationToken,
    pub(super) abort: CancellationToken,
    /// Idle connections: regular ones, and spare ones.
    pub(super) waiting: [Arc<IdleConnections>; 2],
}

impl Shared {
    fn builder(&self, spare: bool) -> Builder<TokioExecutor> {
        let limits = &self.limits;
        let mut builder = Builder::new(TokioExecutor::new());
        builder
            .http1()
            // The library's limit would also end idle connections; the state machine here distinguishes the two.
            .header_read_timeout(None)
            .keep_alive(!spare)
            .max_buf_size(BUFFER_BYTES.max(limits.max_header_bytes));
        if limits.max_headers != 100 {
            // Its default of 100 needs no allocation.
            builder.http1().max_headers(limits.max_headers);
        }
        builder
            .http2()
            .timer(TokioTimer::new())
            .keep_alive_interval(PING)
            .keep_alive_timeout(PING)
            .max_concurrent_streams(limits.max_h2_streams)
            .max_header_list_size(u32::try_from(limits.max_header_bytes).unwrap_or(u32::MAX));
        builder
    }

    /// Serves a connection to its end; `spare` ones get one answer of the spare router.
    pub(super) async fn connection(
        &self,
        stream: TcpStream,
        peer: SocketAddr,
        spare: bool,
        keep: ConnectionResources,
        entry: Arc<IdleEntry>,
    ) -> Reason {
        let stream = SharedStream::new(stream);
        let watched = stream.clone();
        let Some(tls) = &self.tls else { return self.requests(stream, watched, peer, spare, keep, entry).await };
        let handshake = timeout(self.limits.header_timeout, tls.accept(stream));
        let handshake = entry.displaced.run_until_cancelled(handshake);
        match self.stop.run_until_cancelled(handshake).await {
            None => Reason::Stop,
            Some(None) => Reason::Displaced,
            Some(Some(Err(_))) => Reason::HeaderTimeout,
            Some(Some(Ok(Err(error)))) => {
                tracing::debug!(%peer, %error, "TLS handshake failed");
                Reason::Handshake
            }
            Some(Some(Ok(Ok(stream)))) => self.requests(stream, watched, peer, spare, keep, entry).await,
        }
    }

    async fn requests<S>(
        &self,
        stream: S,
        watched: SharedStream,
        peer: SocketAddr,
        spare: bool,
        keep: ConnectionResources,
        entry: Arc<IdleEntry>,
    ) -> Reason
    where
        S: AsyncRead + AsyncWrite + Unpin + Send + 'static,
    {
        let state = State::new(Arc::clone(&entry));
        let begun = Arc::new(Notify::new());
        let service = RequestService {
            app: if spare { self.spare.clone() } else { self.app.clone() },
            peer,
            limits: Arc::clone(&self.limits),
            state: Arc::clone(&state),
            only_one: spare.then(|| Arc::clone(&begun)),
        };
        let builder = self.builder(spare);
        let socket = TokioIo::new(Socket::new(stream, Arc::clone(&state), keep));
        let mut connection = std::pin::pin!(builder.serve_connection(socket, service));
        let mut clock = interval(self.limits.tick());
        clock.set_missed_tick_behavior(MissedTickBehavior::Delay);
        // Reason and start of a graceful shutdown.
        let mut closing: Option<(Reason, Instant)> = None;
        loop {
            let reason = tokio::select! {
                biased;
                ended = connection.as_mut() => {
                    let reason = if ended.is_ok() { Reason::Normal } else { Reason::Error };
                    return closing.map_or(reason, |(reason, _)| reason);
                }
                () = self.abort.cancelled() => {
                    state.abandon();
                    return Reason::Drain;
                }
                () = self.stop.cancelled(), if !matches!(closing, Some((Reason::Stop, _))) => Reason::Stop,
                () = entry.displaced.cancelled(), if closing.is_none() => {
                    if state.is_idle() {
                        state.abandon();
                        return Reason::Displaced;
                    }
                    // A request has just arrived: its response announces the close.
                    Reason::Displaced
                }
                () = begun.notified(), if closing.is_none() => Reason::Spare,
                _ = clock.tick() => {
                    // A body that is not read hides the end of the connection from the protocol.
                    if !state.is_idle() && watched.is_closed_by_peer() {
                        state.abandon();
                        return Reason::Normal;
                    }
                    let Some(reason) = overdue(&state, &self.limits, closing) else { continue };
                    if reason != Reason::Idle || closing.is_some() {
                        state.abandon();
                        return reason;
                    }
                    reason
                }
            };
            // A request that has just arrived is still served.
            closing = Some((reason, Instant::now()));
            connection.as_mut().graceful_shutdown();
        }
    }
}

/// The limit that a connection exceeds, if any.
fn overdue(state: &State, limits: &Limits, closing: Option<(Reason, Instant)>) -> Option<Reason> {
    match closing {
        Some((reason, since)) if state.is_idle() => (since.elapsed() >= CLOSE_TIMEOUT).then_some(reason),
        // Idleness is what the shutdown waits for.
        Some(_) => state.exceeded_limit(limits).filter(|reason| *reason != Reason::Idle),
        None => state.exceeded_limit(limits),
    }
}
