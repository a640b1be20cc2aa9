//! One process has the database for itself: a lock that ends with its connection, or is taken from it after some
//! seconds of silence, and a number that the next
//! process raises, so that the one before changes nothing any more even where it does not know of it.

use super::place::Place;
use super::schema::{hash, schema};
use super::transaction::{Fence, read, write};
use crate::CatalogError;
use crate::link::{Link, Value};
use crate::trouble::Trouble;
use sqlx::AssertSqlSafe;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{RecvTimeoutError, Sender, channel};
use std::thread::JoinHandle;
use std::time::Duration;

/// Distinguishes the lock of the process that has the database, and that of changes, from those that others take.
const OWNER: i32 = 0x6361_6766;
const CHANGES: i32 = 0x6361_6767;
/// How often the process that has the database says that it is well, and looks at the connection with the lock.
const PAUSE: Duration = Duration::from_secs(1);
/// After how much silence another one may take it.
const SILENCE: Duration = Duration::from_secs(8);
/// How long connections that are ended take for it.
const ENDING: Duration = Duration::from_millis(200);
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
        let explain = |trouble: Trouble| trouble.explain(&name);
        let mut link = place.of_owner().connect().map_err(explain)?;
        let hash = hash(&read(&mut link, LIMIT, schema).map_err(explain)?);
        let is_free = |link: &mut Link| Ok(try_lock(link, hash)? || (end_silent(link, hash)? && try_lock(link, hash)?));
        if !is_free(&mut link).map_err(explain)? {
            return Err(in_use(&mut link, hash, &name));
        }
        // Before it waits for changes: what the last owner said is old.
        let began = read(&mut link, LIMIT, |link| link.execute("UPDATE catalogue SET seen = clock_timestamp()", &[]));
        began.map_err(explain)?;
        let taken: Result<i64, Trouble> = write(&mut link, TAKING, None, |link| {
            // Until the changes that earlier owners have begun are made or given up.
            link.batch(AssertSqlSafe(format!("SELECT pg_advisory_xact_lock({CHANGES}, {hash})")))?;
            link.only("UPDATE catalogue SET taken = taken + 1, seen = clock_timestamp() RETURNING taken", &[])
        });
        let taken = taken.map_err(|trouble| match trouble.is_slow() {
            true => CatalogError::InUse(format!("{name} is still being changed by its last owner")),
            false => explain(trouble),
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

/// Says that this process is well, and sees that the lock is held, by another connection where the one before has
/// ended. Whether nobody else has had it.
fn keep(kept: &mut Option<Link>, place: &Place, hash: i32, taken: i64) -> Result<bool, CatalogError> {
    let sql = "UPDATE catalogue SET seen = clock_timestamp() WHERE taken = $1";
    let is_own = |link: &mut Link| read(link, LIMIT, |link| Ok(link.execute(sql, &[Value::Integer(taken)])? == 1));
    if let Some(link) = kept {
        match is_own(link) {
            Ok(is_own) => return Ok(is_own),
            Err(_) => *kept = None,
        }
    }
    let explain = |trouble: Trouble| trouble.explain(&place.name);
    let mut link = place.connect().map_err(explain)?;
    let is_own = is_own(&mut link).map_err(explain)?;
    // What is not ours any more is not locked. Otherwise the server may yet have to notice that the connection before has ended.
    if is_own && try_lock(&mut link, hash).map_err(explain)? {
        *kept = Some(link);
    }
    Ok(is_own)
}

fn try_lock(link: &mut Link, hash: i32) -> Result<bool, Trouble> {
    read(link, LIMIT, |link| link.only(AssertSqlSafe(format!("SELECT pg_try_advisory_lock({OWNER}, {hash})")), &[]))
}

/// Ends the connections by which another process has the database, or changes it, where that has been silent for long:
/// it stands still, or nothing of it comes
/// through. Those that have just begun are left. Whether any was ended. What it does later is refused, as its number
/// is not the last one.
fn end_silent(link: &mut Link, hash: i32) -> Result<bool, Trouble> {
    let sql = "SELECT count(pg_terminate_backend(pid)) FROM pg_locks WHERE locktype = 'advisory' AND granted \
        AND classid::bigint IN ($1, $2) AND objid::bigint = $3 AND pid <> pg_backend_pid() \
        AND database = (SELECT oid FROM pg_database WHERE datname = current_database()) \
        AND pid IN (SELECT pid FROM pg_stat_activity \
            WHERE clock_timestamp() - backend_start > make_interval(secs => $4)) \
        AND (SELECT clock_timestamp() - seen > make_interval(secs => $4) FROM catalogue)";
    let [owner, changes, hash] = [OWNER, CHANGES, hash].map(|number| Value::Integer((number as u32).into()));
    let ended: i64 =
        read(link, LIMIT, |link| link.only(sql, &[owner, changes, hash, Value::Real(SILENCE.as_secs_f64())]))?;
    if ended > 0 {
        // They take a moment to end.
        std::thread::sleep(ENDING);
    }
    Ok(ended > 0)
}

fn in_use(link: &mut Link, hash: i32, name: &str) -> CatalogError {
    let sql = "SELECT application_name || coalesce(' from ' || host(client_addr), '') FROM pg_locks JOIN pg_stat_activity USING (pid) WHERE locktype = 'advisory' AND classid::bigint = $1 AND objid::bigint = $2 AND granted AND database = (SELECT oid FROM pg_database WHERE datname = current_database()) LIMIT 1";
    let values = [OWNER, hash].map(|number| Value::Integer((number as u32).into()));
    let found: Result<String, Trouble> = read(link, LIMIT, |link| link.only(sql, &values));
    let who = found.map_or_else(|_| "another process".to_owned(), |who| format!("`{who}`"));
    CatalogError::InUse(format!("{name} is used by {who}; stop that, or name another schema in the address"))
}
