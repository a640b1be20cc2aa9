//! Connections that wait for their client: when places run out, one of them makes way. Those that have not sent any request go first, then
//! those between two, unless the next may be on its way; the one that has waited longest before all others of its kind.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;
use tokio::time::Instant;
use tokio_util::sync::CancellationToken;

/// A connection between two requests is left alone for so long.
const BETWEEN_REQUESTS: Duration = Duration::from_secs(1);

/// Connections without a request, in the order in which they make way.
#[derive(Default)]
pub(super) struct Waiting(Mutex<List>);

#[derive(Default)]
struct List {
    next: u64,
    /// By whether they have sent a request before, and since when they wait.
    connections: BTreeMap<(bool, u64), (Instant, CancellationToken)>,
}

/// A connection's entry; gone when dropped.
pub(super) struct Entry {
    waiting: Arc<Waiting>,
    /// Where it is listed; nowhere while a request is at work.
    place: Mutex<Option<(bool, u64)>>,
    /// Cancelled when the connection has to go.
    pub(super) displaced: CancellationToken,
}

impl Waiting {
    fn lock(&self) -> MutexGuard<'_, List> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Adds a connection that has sent nothing.
    pub(super) fn enter(self: &Arc<Self>) -> Entry {
        let entry = Entry { waiting: Arc::clone(self), place: Mutex::default(), displaced: CancellationToken::new() };
        entry.wait(false);
        entry
    }

    /// Closes the first connection of the list; false if none can be closed.
    pub(super) fn displace(&self) -> bool {
        let mut list = self.lock();
        let Some(first) = list.connections.first_entry() else { return false };
        let ((has_asked, _), (since, _)) = (*first.key(), first.get());
        if has_asked && since.elapsed() < BETWEEN_REQUESTS {
            return false;
        }
        first.remove().1.cancel();
        true
    }
}

impl Entry {
    fn place(&self) -> MutexGuard<'_, Option<(bool, u64)>> {
        self.place.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The connection waits for its client, which has sent a request before or has not.
    pub(super) fn wait(&self, has_asked: bool) {
        let mut list = self.waiting.lock();
        let place = (has_asked, list.next);
        list.next += 1;
        list.connections.insert(place, (Instant::now(), self.displaced.clone()));
        *self.place() = Some(place);
    }

    /// The connection has a request at work.
    pub(super) fn work(&self) {
        let mut list = self.waiting.lock();
        if let Some(place) = self.place().take() {
            list.connections.remove(&place);
        }
    }
}

impl Drop for Entry {
    fn drop(&mut self) {
        self.work();
    }
}
