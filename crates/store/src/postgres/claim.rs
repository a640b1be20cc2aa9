//! One process has the database for itself: a lock that ends with its connection, and a number that the next process raises, so that the one before
//! changes nothing any more even where it does not know of it.

use super::link::{Fence, Link};
use super::place::Place;
use super::rows::only;
use super::schema::{hash, schema};
use super::trouble::Trouble;
use crate::CatalogError;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{RecvTimeoutError, Sender, channel};
use std::thread::JoinHandle;
use std::time::Duration;

/// Distinguishes the lock of the process that has the database, and that of changes, from those that others take.
pub(super) const OWNER: i32 = 0x6361_6766;
const CHANGES: i32 = 0x6361_6767;
/// How often the connection with the lock is looked at.
const PAUSE: Duration = Duration::from_secs(1);
/// How long such a call may take. Taking waits for the changes that are under way.
const LIMIT: Duration = Duration::from_secs(5);
const TAKING: Duration = Duration::from_secs(60);

/// Keeps the lock while it lives.
pub(super) struct Claim {
    lost: Arc<AtomicBool>,
    // Dropped before the thread is waited for.
    stop: Option<Sender<()>>,
    keeper: Option<JoinHandle<()>>,
}

impl Claim {
    pub(super) fn take(place: &Place) -> Result<(Self, Fence), CatalogError> {
        let name = place.name.clone();
        let link = Link::connect(&place.of_owner())?;
        let schema = link.read(LIMIT, &async |link: &Link| schema(link).await).map_err(|e| e.explain(&name))?;
        let hash = hash(&schema);
        if !try_lock(&link, hash).map_err(|e| e.explain(&name))? {
            return Err(in_use(&link, hash, &name));
        }
        let taken = link.write(TAKING, None, &async |link: &Link| {
            // Until the changes that earlier owners have begun are made or given up.
            link.query("SELECT pg_advisory_xact_lock($1, $2)", &[&CHANGES, &hash]).await?;
            only::<i64>(&link.query("UPDATE catalogue SET taken = taken + 1 RETURNING taken", &[]).await?)
        });
        let taken = taken.map_err(|trouble| match trouble.is_slow() {
            true => CatalogError::InUse(format!("{name} is still being changed by its last owner")),
            false => trouble.explain(&name),
        })?;
        let begin =
            format!("BEGIN; SELECT pg_advisory_xact_lock_shared({CHANGES}, {hash}); SELECT taken FROM catalogue");
        let (lost, place) = (Arc::new(AtomicBool::new(false)), place.of_owner());
        let (stop, stopped) = channel::<()>();
        let told = Arc::clone(&lost);
        let keep = move || {
            let mut link = Some(link);
            while stopped.recv_timeout(PAUSE) == Err(RecvTimeoutError::Timeout) {
                match keep(&mut link, &place, hash, taken) {
                    Ok(true) => {}
                    Ok(false) => return told.store(true, Ordering::SeqCst),
                    // It is tried again; nothing is lost until another process has it.
                    Err(error) => tracing::warn!(%error, "the database's lock is not held"),
                }
            }
        };
        let keeper = std::thread::Builder::new().name("owner".to_owned()).spawn(keep);
        let keeper = keeper.map_err(|error| CatalogError::Failed(format!("no thread can be started: {error}")))?;
        Ok((Self { lost, stop: Some(stop), keeper: Some(keeper) }, Fence { begin, taken }))
    }

    /// Whether another process has the database now.
    pub(super) fn is_lost(&self) -> bool {
        self.lost.load(Ordering::SeqCst)
    }
}

impl Drop for Claim {
    fn drop(&mut self) {
        self.stop = None;
        if let Some(keeper) = self.keeper.take() {
            // It has ended, whatever it says.
            let _ = keeper.join();
        }
    }
}

/// Sees that the lock is held, by another connection where the one before has ended. Whether nobody else has had it.
fn keep(kept: &mut Option<Link>, place: &Place, hash: i32, taken: i64) -> Result<bool, CatalogError> {
    let asked = |link: &Link| {
        let now = link.read(LIMIT, &async |link: &Link| only(&link.query("SELECT taken FROM catalogue", &[]).await?));
        now.map(|now: i64| now == taken).map_err(|trouble| trouble.explain(&place.name))
    };
    if let Some(link) = kept {
        match asked(link) {
            Ok(is_own) => return Ok(is_own),
            Err(_) => *kept = None,
        }
    }
    let link = Link::connect(place)?;
    let is_own = asked(&link)?;
    // What is not ours any more is not locked. Otherwise the server may yet have to notice that the connection before has ended.
    if is_own && try_lock(&link, hash).map_err(|trouble| trouble.explain(&place.name))? {
        *kept = Some(link);
    }
    Ok(is_own)
}

fn try_lock(link: &Link, hash: i32) -> Result<bool, Trouble> {
    link.read(LIMIT, &async |link: &Link| {
        only(&link.query("SELECT pg_try_advisory_lock($1, $2)", &[&OWNER, &hash]).await?)
    })
}

fn in_use(link: &Link, hash: i32, name: &str) -> CatalogError {
    let sql = "SELECT application_name || coalesce(' from ' || host(client_addr), '') FROM pg_locks JOIN pg_stat_activity USING (pid) WHERE locktype = 'advisory' AND classid::bigint = $1 AND objid::bigint = $2 AND granted AND database = (SELECT oid FROM pg_database WHERE datname = current_database()) LIMIT 1";
    let (class, object) = (i64::from(OWNER as u32), i64::from(hash as u32));
    let found = link.read(LIMIT, &async |link: &Link| only::<String>(&link.query(sql, &[&class, &object]).await?));
    let who = found.map_or_else(|_| "another process".to_owned(), |who| format!("`{who}`"));
    CatalogError::InUse(format!("{name} is used by {who}; stop that, or name another schema in the address"))
}
