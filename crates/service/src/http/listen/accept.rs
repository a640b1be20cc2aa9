//! Accepting connections, as many as there are places, until the service stops.

use super::Limits;
use super::connection::Shared;
use super::idle::IdleConnections;
use super::linger::LingeringPlaces;
use super::peers::Peers;
use super::socket::ConnectionResources;
use axum::Router;
use futures_util::FutureExt as _;
use socket2::TcpKeepalive;
use std::io::{self, ErrorKind};
use std::net::SocketAddr;
use std::pin::Pin;
use std::sync::Arc;
use std::time::Duration;
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::{OwnedSemaphorePermit, Semaphore};
use tokio::task::unconstrained;
use tokio::time::{sleep, timeout};
use tokio_rustls::TlsAcceptor;
use tokio_util::sync::CancellationToken;
use tokio_util::task::TaskTracker;

/// How long a new connection waits for the slot of a displaced one.
const DISPLACE_TIMEOUT: Duration = Duration::from_secs(1);

/// First and longest pause after an accept error, such as running out of file descriptors.
const PAUSES: (Duration, Duration) = (Duration::from_millis(10), Duration::from_secs(1));

/// Serves `app` on `listener` until `stop`, then lets requests in progress finish within the drain time.
///
/// If all slots are taken, a connection without a request is closed in favour of a new one, preferring those that never sent a request. If
/// all are serving requests, connections beyond the limit get one response of `spare`, which should answer health checks and otherwise 503;
/// beyond the spare slots they are closed. So are those of an address beyond its share, unless an idle one of it can make way. On `stop` all connections are shut down gracefully; streaming handlers must watch the same
/// token. Requests carry the peer address as [`axum::extract::ConnectInfo`].
///
/// # Errors
/// None at present: accept errors are logged and retried.
pub async fn serve(
    listener: TcpListener,
    app: Router,
    spare: Router,
    limits: Limits,
    tls: Option<Arc<rustls::ServerConfig>>,
    stop: CancellationToken,
) -> io::Result<()> {
    let mut acceptor = Acceptor {
        places: Arc::new(Semaphore::new(limits.max_connections)),
        spare_places: Arc::new(Semaphore::new(limits.spare_connections)),
        lingering: LingeringPlaces::new(limits.max_lingering),
        peers: Arc::default(),
        tracker: TaskTracker::new(),
        shared: Arc::new(Shared {
            app,
            spare,
            limits: Arc::new(limits),
            tls: tls.map(TlsAcceptor::from),
            stop: stop.clone(),
            abort: CancellationToken::new(),
            waiting: Default::default(),
        }),
        pause: PAUSES.0,
    };
    while let Some(accepted) = stop.run_until_cancelled(listener.accept()).await {
        match accepted {
            Ok((stream, peer)) => acceptor.admit(stream, peer),
            Err(error) => {
                stop.run_until_cancelled(acceptor.failed(&error)).await;
            }
        }
    }
    // Refuse connections instead of queueing them while draining.
    drop(listener);
    acceptor.drain().await;
    Ok(())
}

struct Acceptor {
    places: Arc<Semaphore>,
    spare_places: Arc<Semaphore>,
    lingering: LingeringPlaces,
    peers: Arc<Peers>,
    tracker: TaskTracker,
    shared: Arc<Shared>,
    /// Next pause after an error.
    pause: Duration,
}

impl Acceptor {
    fn admit(&mut self, stream: TcpStream, peer: SocketAddr) {
        self.pause = PAUSES.0;
        let [waiting, spare_waiting] = &self.shared.waiting;
        let make_room = |address| waiting.displace(Some(address)) || spare_waiting.displace(Some(address));
        let Some(peer_place) = self.peers.enter(peer.ip(), self.shared.limits.max_per_address, make_room) else {
            metrics::counter!("cager_connections_rejected_total", "reason" => "address").increment(1);
            return;
        };
        // First come, first served: a slot that becomes free goes to the connection that was waiting first.
        let admitted = admit(&self.places, waiting).map(|turn| (turn, false, waiting));
        let admitted = admitted.or_else(|| Some((admit(&self.spare_places, spare_waiting)?, true, spare_waiting)));
        let Some((turn, spare, waiting)) = admitted else {
            metrics::counter!("cager_connections_rejected_total", "reason" => "full").increment(1);
            return;
        };
        // Frames are small and latency matters. Errors mean that the socket is closed.
        let _ = stream.set_nodelay(true);
        let _ = socket2::SockRef::from(&stream).set_tcp_keepalive(&keep_alive(self.shared.limits.write_timeout));
        let entry = Arc::new(waiting.enter(Some(peer_place)));
        let lingering = self.lingering.clone();
        let (tracker, shared) = (self.tracker.clone(), Arc::clone(&self.shared));
        self.tracker.spawn(async move {
            let permit = entry.displaced.run_until_cancelled(timeout(DISPLACE_TIMEOUT, turn)).await;
            let Some(Ok(permit)) = permit else {
                metrics::counter!("cager_connections_rejected_total", "reason" => "full").increment(1);
                return;
            };
            if spare {
                metrics::counter!("cager_connections_rejected_total", "reason" => "spare").increment(1);
            }
            let keep = ConnectionResources {
                tracker,
                abort: shared.abort.clone(),
                lingering,
                place: Box::new(ConnectionSlot::new(permit)),
            };
            let reason = shared.connection(stream, peer, spare, keep, entry).await;
            metrics::counter!("cager_connections_closed_total", "reason" => reason.label()).increment(1);
            tracing::trace!(%peer, reason = reason.label(), "connection closed");
        });
    }

    /// Waits after an accept error: without a pause, a process out of file descriptors would spin.
    async fn failed(&mut self, error: &io::Error) {
        // The client went away before it was accepted.
        if matches!(error.kind(), ErrorKind::ConnectionAborted | ErrorKind::ConnectionReset) {
            return;
        }
        metrics::counter!("cager_accept_errors_total").increment(1);
        tracing::error!(%error, "cannot accept connections; raise the limit of open files if this goes on");
        sleep(self.pause).await;
        self.pause = (self.pause * 2).min(PAUSES.1);
    }

    async fn drain(self) {
        self.tracker.close();
        if timeout(self.shared.limits.drain_timeout, self.tracker.wait()).await.is_err() {
            tracing::warn!(connections = self.tracker.len(), "drain time is over; cutting the remaining connections");
            self.shared.abort.cancel();
            // Each needs only to be polled once more.
            let _ = timeout(Duration::from_secs(1), self.tracker.wait()).await;
        }
    }
}

/// Resolves to a connection permit.
type PermitFuture = Pin<Box<dyn Future<Output = OwnedSemaphorePermit> + Send>>;

/// A permit now, or as soon as an idle connection has been displaced; `None` if all are serving requests.
fn admit(places: &Arc<Semaphore>, waiting: &IdleConnections) -> Option<PermitFuture> {
    let mut turn = Box::pin(unconstrained(Arc::clone(places).acquire_owned()));
    // Polling once enters the semaphore's queue.
    match turn.as_mut().now_or_never() {
        Some(permit) => permit.ok().map(|permit| Box::pin(std::future::ready(permit)) as PermitFuture),
        None if waiting.displace(None) => {
            Some(Box::pin(async move { turn.await.expect("the semaphore is never closed") }))
        }
        None => None,
    }
}

/// TCP keep-alive, so that streams that wait for news end when their client has vanished: after two minutes with the usual limit for a client
/// that does not read, sooner with shorter ones.
fn keep_alive(write_timeout: Duration) -> TcpKeepalive {
    let interval = Duration::from_secs((write_timeout.as_secs() / 20).clamp(1, 15));
    TcpKeepalive::new().with_time(4 * interval).with_interval(interval).with_retries(4)
}

/// A connection's slot, counted in the metrics.
struct ConnectionSlot {
    _permit: OwnedSemaphorePermit,
}

impl ConnectionSlot {
    fn new(permit: OwnedSemaphorePermit) -> Self {
        metrics::counter!("cager_connections_total").increment(1);
        metrics::gauge!("cager_connections").increment(1.0);
        Self { _permit: permit }
    }
}

impl Drop for ConnectionSlot {
    fn drop(&mut self) {
        metrics::gauge!("cager_connections").decrement(1.0);
    }
}
