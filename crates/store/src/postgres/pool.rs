//! The connections of one process to a database.

use super::place::Place;
use super::transaction::{self, Fence};
use crate::CatalogError;
use crate::link::Link;
use crate::trouble::Trouble;
use std::sync::{Condvar, Mutex, MutexGuard, Once, OnceLock, PoisonError};
use std::time::{Duration, Instant};

/// Most connections at once, and so most calls.
const CONNECTIONS: usize = 8;
/// How much longer than the database a call waits, for the way there and back.
const WAY: Duration = Duration::from_secs(2);
/// How often a connection is asked for again where the server gave none.
const RETRY_INTERVAL: Duration = Duration::from_secs(1);

pub(super) struct Pool {
    place: Place,
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
    /// Calls under way, those that wait for a connection included.
    taken: usize,
    /// How many are used or being made.
    used: usize,
    /// How often some were closed, so that the server may give others.
    closed: u64,
}

impl Pool {
    /// Begins with a connection. `limit` is how long the database lets statements take.
    pub(super) fn new(place: Place, link: Link, limit: Duration) -> Self {
        let links = Links { idle: vec![link], ..Links::default() };
        Self {
            place,
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

    pub(super) fn read<T>(&self, mut work: impl FnMut(&mut Link) -> Result<T, Trouble>) -> Result<T, CatalogError> {
        self.twice(|link| transaction::read(link, self.limit, &mut work))
    }

    /// Does `work` in a transaction.
    pub(super) fn write<T>(&self, work: impl Fn(&mut Link) -> Result<T, Trouble>) -> Result<T, CatalogError> {
        self.twice(|link| transaction::write(link, self.limit, self.fence.get(), &work))
    }

    /// Calls once, and once more by a new connection where nothing was changed and that may help.
    fn twice<T>(&self, mut call: impl FnMut(&mut Link) -> Result<T, Trouble>) -> Result<T, CatalogError> {
        let outcome = match self.once(false, &mut call)? {
            Err(trouble) if trouble.is_passing() => {
                tracing::debug!(?trouble, "a call of the database is tried again");
                self.once(true, &mut call)?
            }
            outcome => outcome,
        };
        outcome.map_err(|trouble| trouble.explain(self.name()))
    }

    fn once<T>(
        &self,
        is_new: bool,
        call: impl FnOnce(&mut Link) -> Result<T, Trouble>,
    ) -> Result<Result<T, Trouble>, CatalogError> {
        let place = self.wait_for_place()?;
        let (mut link, used) = self.link(is_new)?;
        let outcome = call(&mut link);
        if outcome.as_ref().is_err_and(Trouble::is_broken) {
            // Not while others wait for the lock.
            let idle = std::mem::take(&mut self.links().idle);
            drop((link, idle));
            self.links().closed += 1;
        } else {
            self.links().idle.push(link);
        }
        drop(used);
        drop(place);
        Ok(outcome)
    }

    fn wait_for_place(&self) -> Result<Taken<'_>, CatalogError> {
        let is_full = |links: &mut Links| links.taken >= CONNECTIONS;
        let waited = self.freed.wait_timeout_while(self.links(), self.limit, is_full);
        let (mut links, waited) = waited.unwrap_or_else(PoisonError::into_inner);
        if waited.timed_out() {
            let said = format!("{} is too slow: {} connections are busy, and others wait", self.name(), CONNECTIONS);
            return Err(CatalogError::Away(said));
        }
        links.taken += 1;
        Ok(Taken(self))
    }

    /// A connection, a new one where that is wanted or none is idle.
    fn link(&self, is_new: bool) -> Result<(Link, Used<'_>), CatalogError> {
        let (kept, closed) = {
            let mut links = self.links();
            links.used += 1;
            (if is_new { None } else { links.idle.pop() }, links.closed)
        };
        let used = Used(self);
        let made = kept.map_or_else(|| self.place.connect(), Ok);
        match made {
            Err(trouble) if trouble.is_full() => {
                drop(used);
                self.wait_for_link(trouble, closed)
            }
            made => made.map(|link| (link, used)).map_err(|trouble| trouble.explain(self.name())),
        }
    }

    /// A connection that another call of this process gives back, or that the server gives after all: before, it gave none. `closed` is how often some were closed
    /// before it was asked.
    ///
    /// # Errors
    /// No other call has one, or they take too long.
    fn wait_for_link(&self, mut trouble: Trouble, mut closed: u64) -> Result<(Link, Used<'_>), CatalogError> {
        self.told.call_once(|| {
            tracing::warn!(
                "{} gives this user fewer than {} connections, so that calls wait for each other: raise its max_connections or the user's limit",
                self.name(),
                CONNECTIONS
            );
        });
        let began = Instant::now();
        loop {
            let waits = |links: &mut Links| links.idle.is_empty() && links.used > 0 && links.closed == closed;
            let waited = self.freed.wait_timeout_while(self.links(), RETRY_INTERVAL, waits);
            let (mut links, _) = waited.unwrap_or_else(PoisonError::into_inner);
            let kept = links.idle.pop();
            let is_hopeless = links.used == 0 && links.closed == closed;
            if kept.is_none() && (is_hopeless || began.elapsed() >= self.limit) {
                return Err(trouble.explain(self.name()));
            }
            links.used += 1;
            closed = links.closed;
            drop(links);
            let used = Used(self);
            match kept.map_or_else(|| self.place.connect(), Ok) {
                Err(now) if now.is_full() => trouble = now,
                made => return made.map(|link| (link, used)).map_err(|trouble| trouble.explain(self.name())),
            }
        }
    }

    fn links(&self) -> MutexGuard<'_, Links> {
        self.links.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// One of the connections that are used or being made.
struct Used<'a>(&'a Pool);

impl Drop for Used<'_> {
    fn drop(&mut self) {
        self.0.links().used -= 1;
        self.0.freed.notify_all();
    }
}

/// One of the calls that there may be at once.
struct Taken<'a>(&'a Pool);

impl Drop for Taken<'_> {
    fn drop(&mut self) {
        self.0.links().taken -= 1;
        self.0.freed.notify_all();
    }
}
