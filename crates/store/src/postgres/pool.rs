//! The connections of one process to a database.

use super::link::{Fence, Link};
use super::place::Place;
use super::trouble::Trouble;
use crate::CatalogError;
use std::sync::{Condvar, Mutex, MutexGuard, Once, OnceLock, PoisonError};
use std::time::Duration;

/// How much longer than the database a call waits, for the way there and back.
const WAY: Duration = Duration::from_secs(2);

pub(super) struct Pool {
    place: Place,
    /// Most connections at once.
    connections: usize,
    /// How long a statement may take.
    limit: Duration,
    /// Set once this process has it for itself.
    fence: OnceLock<Fence>,
    links: Mutex<Links>,
    freed: Condvar,
    /// That the server gives fewer connections is told once.
    told: Once,
}

#[derive(Default)]
struct Links {
    idle: Vec<Link>,
    /// How many are used or being made.
    taken: usize,
}

impl Pool {
    /// Begins with a connection. `limit` is how long the database lets statements take.
    pub(super) fn new(place: Place, link: Link, limit: Duration, connections: usize) -> Self {
        let links = Links { idle: vec![link], taken: 0 };
        Self {
            place,
            connections,
            limit: limit.saturating_add(WAY),
            fence: OnceLock::new(),
            links: Mutex::new(links),
            freed: Condvar::new(),
            told: Once::new(),
        }
    }

    pub(super) fn place(&self) -> &Place {
        &self.place
    }

    pub(super) fn name(&self) -> &str {
        &self.place.name
    }

    /// How often it was taken when this process took it.
    pub(super) fn taken(&self) -> Option<i64> {
        self.fence.get().map(|fence| fence.taken)
    }

    /// From now on nothing is changed after another process has taken it.
    pub(super) fn set_fence(&self, fence: Fence) {
        // There is one already where it was taken twice, which its owner does not do.
        let _ = self.fence.set(fence);
    }

    pub(super) fn read<T>(&self, work: &impl AsyncFn(&Link) -> Result<T, Trouble>) -> Result<T, CatalogError> {
        self.twice(|link| link.read(self.limit, work))
    }

    /// Does `work` in a transaction.
    pub(super) fn write<T>(&self, work: &impl AsyncFn(&Link) -> Result<T, Trouble>) -> Result<T, CatalogError> {
        self.twice(|link| link.write(self.limit, self.fence.get(), work))
    }

    /// Calls once, and once more by a new connection where nothing was changed and that may help.
    fn twice<T>(&self, call: impl Fn(&Link) -> Result<T, Trouble>) -> Result<T, CatalogError> {
        let outcome = match self.once(false, &call)? {
            Err(trouble) if trouble.is_passing() => {
                tracing::debug!(?trouble, "a call of the database is tried again");
                self.once(true, &call)?
            }
            outcome => outcome,
        };
        outcome.map_err(|trouble| trouble.explain(self.name()))
    }

    fn once<T>(
        &self,
        is_new: bool,
        call: impl Fn(&Link) -> Result<T, Trouble>,
    ) -> Result<Result<T, Trouble>, CatalogError> {
        let place = self.wait_for_place()?;
        let kept = if is_new { None } else { self.links().idle.pop() };
        let link = match kept {
            Some(link) => link,
            None => match Link::try_connect(&self.place) {
                Err(trouble) if trouble.is_full() => self.wait_for_link(trouble)?,
                made => made.map_err(|trouble| trouble.explain(self.name()))?,
            },
        };
        let outcome = call(&link);
        // Dropped below, not while others wait for the lock.
        let mut dropped = Vec::new();
        if outcome.as_ref().is_err_and(Trouble::is_broken) {
            dropped.append(&mut self.links().idle);
            dropped.push(link);
        } else {
            self.links().idle.push(link);
        }
        drop(place);
        Ok(outcome)
    }

    fn wait_for_place(&self) -> Result<Taken<'_>, CatalogError> {
        let is_full = |links: &mut Links| links.taken >= self.connections;
        let waited = self.freed.wait_timeout_while(self.links(), self.limit, is_full);
        let (mut links, waited) = waited.unwrap_or_else(PoisonError::into_inner);
        if waited.timed_out() {
            let said =
                format!("{} is too slow: {} connections are busy, and others wait", self.name(), self.connections);
            return Err(CatalogError::Failed(said));
        }
        links.taken += 1;
        Ok(Taken(self))
    }

    /// A connection that another call of this process gives back: the server gives no more than there are.
    ///
    /// # Errors
    /// This process has none but the one that was asked for, or the others take too long.
    fn wait_for_link(&self, trouble: Trouble) -> Result<Link, CatalogError> {
        self.told.call_once(|| {
            tracing::warn!(
                "{} gives this user fewer than {} connections, so that calls wait for each other: raise its max_connections or the user's limit",
                self.name(),
                self.connections
            );
        });
        let is_used = |links: &mut Links| links.idle.is_empty() && links.taken > 1;
        let waited = self.freed.wait_timeout_while(self.links(), self.limit, is_used);
        let (mut links, _) = waited.unwrap_or_else(PoisonError::into_inner);
        links.idle.pop().ok_or_else(|| trouble.explain(self.name()))
    }

    fn links(&self) -> MutexGuard<'_, Links> {
        self.links.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// One of the connections that there may be.
struct Taken<'a>(&'a Pool);

impl Drop for Taken<'_> {
    fn drop(&mut self) {
        self.0.links().taken -= 1;
        // Some wait for a place, and some for a connection.
        self.0.freed.notify_all();
    }
}
