//! Connections that have not sent a request yet: when places run out, the one that has waited longest goes first.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use tokio_util::sync::CancellationToken;

/// Connections without a request, by the order in which they came.
#[derive(Default)]
pub(super) struct Fresh(Mutex<Waiting>);

#[derive(Default)]
struct Waiting {
    next: u64,
    connections: BTreeMap<u64, CancellationToken>,
}

/// A connection's entry; gone when dropped.
pub(super) struct Entry {
    fresh: Arc<Fresh>,
    number: u64,
    /// Cancelled when the connection has to go.
    pub(super) displaced: CancellationToken,
}

impl Fresh {
    fn lock(&self) -> MutexGuard<'_, Waiting> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Adds a connection.
    pub(super) fn enter(self: &Arc<Self>) -> Entry {
        let displaced = CancellationToken::new();
        let mut waiting = self.lock();
        let number = waiting.next;
        waiting.next += 1;
        waiting.connections.insert(number, displaced.clone());
        Entry { fresh: Arc::clone(self), number, displaced }
    }

    /// Closes the connection that has waited longest; false where there is none.
    pub(super) fn displace(&self) -> bool {
        let oldest = self.lock().connections.pop_first();
        oldest.map(|(_, displaced)| displaced.cancel()).is_some()
    }
}

impl Entry {
    /// The connection has sent a request.
    pub(super) fn leave(&self) {
        self.fresh.lock().connections.remove(&self.number);
    }
}

impl Drop for Entry {
    fn drop(&mut self) {
        self.leave();
    }
}
