//! Accepting connections, as many as there are places, until the service stops.

use super::Limits;
use super::connection::Shared;
use super::fresh::Fresh;
use super::socket::Keep;
use axum::Router;
use socket2::TcpKeepalive;
use std::io::{self, ErrorKind};
use std::net::SocketAddr;
use std::sync::Arc;
use std::time::Duration;
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::{OwnedSemaphorePermit, Semaphore};
use tokio::time::{sleep, timeout};
use tokio_rustls::TlsAcceptor;
use tokio_util::sync::CancellationToken;
use tokio_util::task::TaskTracker;

/// How long a connection waits for the place of one that is being closed for it.
const DISPLACED_WITHIN: Duration = Duration::from_secs(1);

/// First and longest pause after an error of accepting, such as having no file descriptor left.
const PAUSES: (Duration, Duration) = (Duration::from_millis(10), Duration::from_secs(1));

/// Serves `app` on `listener` until `stop`, then lets open requests finish within the drain time.
///
/// Where all places are taken, the connection that has waited longest for its first request is closed. Where there is none, connections
/// beyond the limit get one answer of `spare`, which should know health and otherwise say 503; beyond the spare ones they are closed. On `stop` every connection is told at once; streams of the router that have no end of their own must
/// watch the same token. Requests carry their peer as [`axum::extract::ConnectInfo`].
///
/// # Errors
/// None at present: errors of accepting are logged and waited out.
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
        tracker: TaskTracker::new(),
        shared: Arc::new(Shared {
            app,
            spare,
            limits: Arc::new(limits),
            tls: tls.map(TlsAcceptor::from),
            stop: stop.clone(),
            abort: CancellationToken::new(),
            fresh: Arc::new(Fresh::default()),
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
    // Nobody may get into the queue of a service that no longer accepts.
    drop(listener);
    acceptor.drain().await;
    Ok(())
}

struct Acceptor {
    places: Arc<Semaphore>,
    spare_places: Arc<Semaphore>,
    tracker: TaskTracker,
    shared: Arc<Shared>,
    /// Next pause after an error.
    pause: Duration,
}

impl Acceptor {
    fn admit(&mut self, stream: TcpStream, peer: SocketAddr) {
        self.pause = PAUSES.0;
        let place = match Arc::clone(&self.places).try_acquire_owned() {
            Ok(place) => Some(Admitted::Place(place)),
            Err(_) if self.shared.fresh.displace() => Some(Admitted::Soon(Arc::clone(&self.places))),
            Err(_) => Arc::clone(&self.spare_places).try_acquire_owned().ok().map(Admitted::Spare),
        };
        let Some(place) = place else {
            metrics::counter!("cager_connections_rejected_total", "reason" => "full").increment(1);
            return;
        };
        // Frames are small and answers are wanted at once. A socket that refuses is dead anyway.
        let _ = stream.set_nodelay(true);
        let _ = socket2::SockRef::from(&stream).set_tcp_keepalive(&keep_alive());
        // A spare place is of no use to another connection.
        let others = matches!(place, Admitted::Spare(_)).then(Arc::default);
        let entry = Arc::new(others.as_ref().unwrap_or(&self.shared.fresh).enter());
        let (tracker, shared) = (self.tracker.clone(), Arc::clone(&self.shared));
        self.tracker.spawn(async move {
            let (permit, spare) = match place {
                Admitted::Place(permit) => (permit, false),
                Admitted::Spare(permit) => (permit, true),
                Admitted::Soon(places) => {
                    let soon = timeout(DISPLACED_WITHIN, places.acquire_owned());
                    match entry.displaced.run_until_cancelled(soon).await {
                        Some(Ok(Ok(permit))) => (permit, false),
                        _ => return,
                    }
                }
            };
            if spare {
                metrics::counter!("cager_connections_rejected_total", "reason" => "spare").increment(1);
            }
            let keep = Keep { tracker, abort: shared.abort.clone(), place: Box::new(Place::new(permit)) };
            let reason = shared.connection(stream, peer, spare, keep, entry).await;
            metrics::counter!("cager_connections_closed_total", "reason" => reason.label()).increment(1);
            tracing::trace!(%peer, reason = reason.label(), "connection closed");
        });
    }

    /// Waits after an error of accepting: without a pause, a process without file descriptors would spin.
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

/// How a connection gets in.
enum Admitted {
    /// At once.
    Place(OwnedSemaphorePermit),
    /// With the place of one that is being closed.
    Soon(Arc<Semaphore>),
    /// For one answer.
    Spare(OwnedSemaphorePermit),
}

/// The system asks idle peers whether they are still there, so that a follower whose machine is gone does not stay for ever.
fn keep_alive() -> TcpKeepalive {
    TcpKeepalive::new().with_time(Duration::from_secs(60)).with_interval(Duration::from_secs(15)).with_retries(4)
}

/// A connection's place, counted while it is held.
struct Place {
    _permit: OwnedSemaphorePermit,
}

impl Place {
    fn new(permit: OwnedSemaphorePermit) -> Self {
        metrics::counter!("cager_connections_total").increment(1);
        metrics::gauge!("cager_connections").increment(1.0);
        Self { _permit: permit }
    }
}

impl Drop for Place {
    fn drop(&mut self) {
        metrics::gauge!("cager_connections").decrement(1.0);
    }
}
