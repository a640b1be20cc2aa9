//! The catalogue in a PostgreSQL database, for any number of processes.

mod append;
mod claim;
mod place;
mod pool;
mod schema;
mod transaction;

use crate::CatalogError;
use crate::FrameEntry;
use crate::chunks::Chunk;
use crate::engine::Engine;
use crate::link::{Link, Value};
use crate::trouble::Trouble;
use append::Numbers;
use claim::Claim;
use place::Place;
use pool::Pool;
use std::fmt::Debug;
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Duration;
use transaction::read;

/// How long preparing may take, where others may prepare much.
const PREPARING: Duration = Duration::from_secs(60);

/// A catalogue in a database. Several processes can share one.
///
/// Calls block, so that none may come from where that is not allowed, as in asynchronous work of Tokio.
pub struct PostgresCatalog {
    pool: Pool,
    /// Numbers of chunks that nobody else has.
    numbers: Numbers,
    /// Set once this process has it for itself.
    claim: Mutex<Option<Claim>>,
}

impl Debug for PostgresCatalog {
    fn fmt(&self, out: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(out, "PostgresCatalog({})", self.pool.name())
    }
}

impl PostgresCatalog {
    /// Connects to the database at `url` (`postgres://user:password@host:port/database`) and makes its tables, unless they are there: in the schema
    /// `cager`, or the one that `?options=-csearch_path%3D…` names. `sslmode` is `prefer` (not encrypted), or `require` (encrypted, and the certificate
    /// is checked by those that the system trusts, and the file of `sslrootcert`).
    ///
    /// # Errors
    /// [`CatalogError::Newer`].
    pub fn open(url: &str) -> Result<Self, CatalogError> {
        let place = Place::parse(url)?;
        let prepared = place.connect().and_then(|mut link| {
            schema::prepare(&mut link, PREPARING)?;
            let sql = "SELECT setting::bigint FROM pg_settings WHERE name = 'statement_timeout'";
            let limit: i64 = read(&mut link, PREPARING, |link| link.only(sql, &[]))?;
            Ok((link, limit))
        });
        let (link, limit) = prepared.map_err(|trouble| trouble.explain(&place.name))?;
        let limit = match limit {
            // None.
            0 => Duration::MAX,
            milliseconds => Duration::from_millis(milliseconds as u64),
        };
        Ok(Self { pool: Pool::new(place, link, limit), numbers: Numbers::default(), claim: Mutex::new(None) })
    }

    /// Checks the address of a database, with the files that it names, without connecting.
    ///
    /// # Errors
    /// What is wrong with it, without the password.
    pub fn check_address(url: &str) -> Result<(), CatalogError> {
        Place::parse(url).map(drop)
    }

    /// Takes it for this process alone, until this value is dropped or the process ends. What others have opened before changes nothing afterwards.
    /// Gives how often it was taken.
    ///
    /// # Errors
    /// [`CatalogError::InUse`], with who has it.
    pub fn claim(&self) -> Result<i64, CatalogError> {
        let (claim, fence) = Claim::take(self.pool.place())?;
        let taken = fence.taken;
        self.pool.set_fence(fence);
        *self.claimed() = Some(claim);
        Ok(taken)
    }

    fn claimed(&self) -> MutexGuard<'_, Option<Claim>> {
        self.claim.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// What the database is called in messages.
    pub fn name(&self) -> &str {
        self.pool.name()
    }

    /// Which folder has the files of its records; `None` where that was never said.
    pub fn folder(&self) -> Result<Option<String>, CatalogError> {
        self.pool.read(|link| link.only("SELECT folder FROM catalogue", &[]))
    }

    /// Notes which folder has the files of its records, unless that was said before. Gives which it is.
    pub fn set_folder(&self, folder: &str) -> Result<String, CatalogError> {
        let sql = "UPDATE catalogue SET folder = coalesce(folder, $1) RETURNING folder";
        self.pool.write(|link| link.only(sql, &[Value::Text(folder)]))
    }
}

impl Engine for PostgresCatalog {
    const REMOVED: (u32, u32) = (4096, 50_000);

    fn name(&self) -> &str {
        self.pool.name()
    }

    fn read<T>(&self, work: impl FnMut(&mut Link) -> Result<T, Trouble>) -> Result<T, CatalogError> {
        self.pool.read(work)
    }

    fn write<T: Send + 'static>(
        &self,
        _frees: bool,
        work: impl Fn(&mut Link) -> Result<T, Trouble> + Clone + Send + 'static,
    ) -> Result<T, CatalogError> {
        self.pool.write(work)
    }

    fn store(&self, id: &str, chunks: Vec<Chunk>) -> Result<Vec<FrameEntry>, CatalogError> {
        self.pool.write(|link| self.numbers.append(link, id, &chunks))
    }

    fn try_writing(&self) -> Result<(), CatalogError> {
        self.pool.write(|link| link.batch("UPDATE catalogue SET probed = now()").map(drop))
    }

    fn check_owner(&self) -> Result<(), CatalogError> {
        let Some(taken) = self.pool.taken() else { return Ok(()) };
        let now: i64 = self.pool.read(|link| link.only("SELECT taken FROM catalogue", &[]))?;
        if now == taken { Ok(()) } else { Err(CatalogError::TakenOver) }
    }

    fn release(&self) {
        *self.claimed() = None;
    }

    fn is_taken_over(&self) -> bool {
        self.claimed().as_ref().is_some_and(Claim::is_lost)
    }
}
