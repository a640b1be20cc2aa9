//! The life of one connection.

use super::Limits;
use super::service::Requests;
use super::socket::{Keep, Socket};
use super::state::{Reason, State};
use super::waiting::{Entry, Waiting};
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

/// How long a connection without requests may take to say goodbye.
const GOODBYE: Duration = Duration::from_secs(1);
/// Most bytes of HTTP/1.1 held for one connection, each way. A header that never ends stops here.
const BUFFER_BYTES: usize = 128 << 10;
/// Pause after which HTTP/2 asks whether the client is still there, and how long it may take to answer.
const PING: Duration = Duration::from_secs(20);

/// What all connections share.
pub(super) struct Shared {
    pub(super) app: Router,
    pub(super) spare: Router,
    pub(super) limits: Arc<Limits>,
    pub(super) tls: Option<TlsAcceptor>,
    pub(super) stop: CancellationToken,
    pub(super) abort: CancellationToken,
    /// Connections that wait for their client, and the spare ones among them.
    pub(super) waiting: [Arc<Waiting>; 2],
}

impl Shared {
    fn builder(&self, spare: bool) -> Builder<TokioExecutor> {
        let limits = &self.limits;
        let mut builder = Builder::new(TokioExecutor::new());
        builder
            .http1()
            // The library's own limit would also end idle connections; the clock here tells them apart.
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
        keep: Keep,
        entry: Arc<Entry>,
    ) -> Reason {
        let Some(tls) = &self.tls else { return self.requests(stream, peer, spare, keep, entry).await };
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
            Some(Some(Ok(Ok(stream)))) => self.requests(stream, peer, spare, keep, entry).await,
        }
    }

    async fn requests<S>(&self, stream: S, peer: SocketAddr, spare: bool, keep: Keep, entry: Arc<Entry>) -> Reason
    where
        S: AsyncRead + AsyncWrite + Unpin + Send + 'static,
    {
        let state = State::new(Arc::clone(&entry));
        let begun = Arc::new(Notify::new());
        let service = Requests {
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
        // Why and since when the connection is being closed in good order.
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
                    // A request has just come: its answer says that it is the last.
                    Reason::Displaced
                }
                () = begun.notified(), if closing.is_none() => Reason::Spare,
                _ = clock.tick() => {
                    let Some(reason) = overdue(&state, &self.limits, closing) else { continue };
                    if reason != Reason::Idle || closing.is_some() {
                        state.abandon();
                        return reason;
                    }
                    reason
                }
            };
            // A request that has just arrived is still answered.
            closing = Some((reason, Instant::now()));
            connection.as_mut().graceful_shutdown();
        }
    }
}

/// Whether a connection has to be closed, and why.
fn overdue(state: &State, limits: &Limits, closing: Option<(Reason, Instant)>) -> Option<Reason> {
    match closing {
        Some((reason, since)) if state.is_idle() => (since.elapsed() >= GOODBYE).then_some(reason),
        // Being idle is what closing waits for.
        Some(_) => state.verdict(limits).filter(|reason| *reason != Reason::Idle),
        None => state.verdict(limits),
    }
}
