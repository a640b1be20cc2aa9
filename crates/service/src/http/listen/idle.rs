//! Idle connections, in the order in which they are closed when slots run out: first those that never sent a request, then those between
//! two requests, unless the last one has just ended; in each group the longest idle first. One that was just accepted comes last: its request may
//! be on its way.

use super::peers::PeerPlace;
use crate::sync::lock;
use std::collections::BTreeMap;
use std::net::IpAddr;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::sync::{Arc, Mutex};
use std::time::Duration;
use tokio::time::Instant;
use tokio_util::sync::CancellationToken;

/// How long after a request a connection is not displaced.
const BETWEEN_REQUESTS: Duration = Duration::from_secs(1);
/// How long a connection has for its first request before it comes first.
const FIRST_REQUEST: Duration = Duration::from_millis(500);

/// Connections without a request in progress, in the order in which they are displaced.
#[derive(Default)]
pub(super) struct IdleConnections(Mutex<List>);

#[derive(Default)]
struct List {
    next: u64,
    /// Keyed by whether they have sent a request, and by the order in which they became idle.
    connections: BTreeMap<(bool, u64), Idle>,
}

struct Idle {
    since: Instant,
    /// The address that it counts for.
    address: Option<IpAddr>,
    displaced: CancellationToken,
}

/// A connection's entry in the list; removed on drop.
pub(super) struct IdleEntry {
    waiting: Arc<IdleConnections>,
    /// Its key; `None` while a request is in progress.
    place: Mutex<Option<(bool, u64)>>,
    /// Counts it for its address, until it is known who uses it.
    peer: Mutex<Option<PeerPlace>>,
    /// Set when it is closed, and cannot make way for others any more.
    closed: AtomicBool,
    /// Cancelled when the connection has to go.
    pub(super) displaced: CancellationToken,
}

impl IdleConnections {
    /// Adds a connection that has sent nothing.
    pub(super) fn enter(self: &Arc<Self>, peer: Option<PeerPlace>) -> IdleEntry {
        let entry = IdleEntry {
            waiting: Arc::clone(self),
            place: Mutex::default(),
            peer: Mutex::new(peer),
            closed: AtomicBool::new(false),
            displaced: CancellationToken::new(),
        };
        entry.wait(false);
        entry
    }

    /// Closes the first connection of the list, or of those that count for an address; false if none may be closed.
    pub(super) fn displace(&self, of: Option<IpAddr>) -> bool {
        let mut list = lock(&self.0);
        let of_kind = |has_asked: bool, grace: Duration| {
            let mut kind = list.connections.range((has_asked, 0)..=(has_asked, u64::MAX));
            let (&key, idle) = kind.find(|(_, idle)| of.is_none() || idle.address == of)?;
            (idle.since.elapsed() >= grace).then_some(key)
        };
        let first = of_kind(false, FIRST_REQUEST)
            .or_else(|| of_kind(true, BETWEEN_REQUESTS))
            .or_else(|| of_kind(false, Duration::ZERO));
        let displaced = first.and_then(|key| list.connections.remove(&key));
        displaced.inspect(|idle| idle.displaced.cancel()).is_some()
    }
}

impl IdleEntry {
    /// The connection is idle; `has_asked` says whether it has sent a request before.
    pub(super) fn wait(&self, has_asked: bool) {
        let mut list = lock(&self.waiting.0);
        if self.closed.load(Relaxed) {
            return;
        }
        let place = (has_asked, list.next);
        list.next += 1;
        let idle = Idle { since: Instant::now(), address: self.address(), displaced: self.displaced.clone() };
        list.connections.insert(place, idle);
        *lock(&self.place) = Some(place);
    }

    /// The address that it counts for.
    pub(super) fn address(&self) -> Option<IpAddr> {
        lock(&self.peer).as_ref().map(|peer| peer.address)
    }

    /// It is known who uses the connection: it counts for its address no longer.
    pub(super) fn known(&self) {
        drop(lock(&self.peer).take());
    }

    /// The connection is closed.
    pub(super) fn close(&self) {
        self.closed.store(true, Relaxed);
        self.work();
    }

    /// The connection has a request in progress.
    pub(super) fn work(&self) {
        let mut list = lock(&self.waiting.0);
        if let Some(place) = lock(&self.place).take() {
            list.connections.remove(&place);
        }
    }
}

impl Drop for IdleEntry {
    fn drop(&mut self) {
        self.work();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[tokio::test]
    async fn a_connection_just_accepted_is_displaced_last() {
        let list = Arc::new(IdleConnections::default());
        let asked = list.enter(None);
        asked.work();
        asked.wait(true);
        let silent = list.enter(None);
        tokio::time::sleep(BETWEEN_REQUESTS).await;
        let fresh = list.enter(None);
        let gone = || [&silent, &asked, &fresh].map(|entry| entry.displaced.is_cancelled());
        assert!(list.displace(None));
        assert_eq!(gone(), [true, false, false]);
        assert!(list.displace(None));
        assert_eq!(gone(), [true, true, false]);
        assert!(list.displace(None));
        assert_eq!(gone(), [true; 3]);
        assert!(!list.displace(None));
    }
}
