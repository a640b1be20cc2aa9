//! Connections that wait for their client: when places run out, one of them makes way. Those that have not sent any request go first, then
//! those between two; the one that has waited longest before all others of its kind.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use tokio_util::sync::CancellationToken;

/// Connections without a request, in the order in which they make way.
#[derive(Default)]
pub(super) struct Waiting(Mutex<List>);

#[derive(Default)]
struct List {
    next: u64,
    /// By whether they have sent a request before, and since when they wait.
    connections: BTreeMap<(bool, u64), CancellationToken>,
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

    /// Closes the first connection of the list; false where there is none.
    pub(super) fn displace(&self) -> bool {
        let first = self.lock().connections.pop_first();
        first.map(|(_, displaced)| displaced.cancel()).is_some()
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
        list.connections.insert(place, self.displaced.clone());
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
