//! Accepting connections, as many as there are places, until the service stops.

use super::Limits;
use super::connection::Shared;
use super::socket::Keep;
use axum::Router;
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

/// First and longest pause after an error of accepting, such as having no file descriptor left.
const PAUSES: (Duration, Duration) = (Duration::from_millis(10), Duration::from_secs(1));

/// Serves `app` on `listener` until `stop`, then lets open requests finish within the drain time.
///
/// Connections beyond the limit get one answer of `spare`, which should know health and otherwise say 503; beyond the spare
/// ones they are closed. On `stop` every connection is told at once; streams of the router that have no end of their own must
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
        let place = Arc::clone(&self.places).try_acquire_owned().ok();
        let spare = place.is_none();
        let Some(permit) = place.or_else(|| Arc::clone(&self.spare_places).try_acquire_owned().ok()) else {
            metrics::counter!("cager_connections_rejected_total", "reason" => "full").increment(1);
            return;
        };
        if spare {
            metrics::counter!("cager_connections_rejected_total", "reason" => "spare").increment(1);
        }
        // Frames are small and answers are wanted at once. A socket that refuses is dead anyway.
        let _ = stream.set_nodelay(true);
        let keep = Keep {
            tracker: self.tracker.clone(),
            abort: self.shared.abort.clone(),
            place: Box::new(Place::new(permit)),
        };
        let shared = Arc::clone(&self.shared);
        self.tracker.spawn(async move {
            let reason = shared.connection(stream, peer, spare, keep).await;
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
