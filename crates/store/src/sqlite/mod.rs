//! The catalogue in one SQLite file, for one process at a time.

#[cfg(test)]
mod tests;
mod upkeep;
mod writer;

use crate::chunks::Chunk;
use crate::engine::{Engine, phase_value, session};
use crate::link::{Link, Value};
use crate::migrations::{SQLITE, missing};
use crate::trouble::Trouble;
use crate::{CagePlace, CatalogError, FrameEntry, Phase, checksums};
use sqlx::sqlite::{SqliteAutoVacuum, SqliteConnectOptions, SqliteJournalMode, SqliteSynchronous};
use sqlx::{AssertSqlSafe, ConnectOptions as _};
use std::fs::OpenOptions;
use std::os::unix::fs::OpenOptionsExt as _;
use std::path::Path;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;
use upkeep::Upkeep;
use writer::Writer;

/// What the database is called in messages.
const NAME: &str = "the catalogue";
/// Pages of 4 KiB in the log from which on who writes writes it back.
const LOG_PAGES: usize = upkeep::RESERVE / 2 / 4096;
/// How often a deletion asks for the reserve on a full disk, and its pause where that is not there.
const RESERVE_TRIES: u32 = 4;
const RESERVE_PAUSE: Duration = Duration::from_millis(50);
/// Connections for reading that are kept.
const READERS: usize = 4;
/// How long to wait for a lock, which only a tool beside the service can hold.
const BUSY: Duration = Duration::from_secs(5);

/// A catalogue in a file.
#[derive(Debug)]
pub struct SqliteCatalog {
    // In this order: what looks after the file ends before what writes to it.
    upkeep: Upkeep,
    readers: Mutex<Vec<Link>>,
    writer: Arc<Writer>,
    path: Box<Path>,
    reading: SqliteConnectOptions,
}

impl SqliteCatalog {
    /// Opens the file, which is created if it is missing: for its user alone. Another process must not use it meanwhile.
    ///
    /// # Errors
    /// [`CatalogError::Newer`]; [`CatalogError::Corrupt`] for a file that is none.
    pub fn open(path: &Path) -> Result<Self, CatalogError> {
        match Self::open_as_it_is(path) {
            // Without its log nothing can be deleted.
            Err(CatalogError::Full) if upkeep::give_reserve(path) => Self::open_as_it_is(path),
            outcome => outcome,
        }
    }

    fn open_as_it_is(path: &Path) -> Result<Self, CatalogError> {
        let made = OpenOptions::new().read(true).write(true).create(true).truncate(false).mode(0o600).open(path);
        made.map_err(|error| match error.kind() {
            std::io::ErrorKind::StorageFull => CatalogError::Full,
            _ => CatalogError::Failed(error.to_string()),
        })?;
        let at = options(path);
        // The first is only effective before the first table.
        let writing = at
            .clone()
            .auto_vacuum(SqliteAutoVacuum::Incremental)
            .journal_mode(SqliteJournalMode::Wal)
            .synchronous(SqliteSynchronous::Full)
            // Another thread does it before, unless much is written: what the log alone holds must fit the reserve, or
            // a full disk stays full.
            .pragma("wal_autocheckpoint", LOG_PAGES.to_string());
        let mut link = connect(&writing)?;
        let version = link.only("PRAGMA user_version", &[]).map_err(explain)?;
        for (version, sql) in missing(&SQLITE, version)? {
            let step = format!("BEGIN; {sql} PRAGMA user_version = {version}; COMMIT;");
            link.batch(AssertSqlSafe(step)).map_err(explain)?;
        }
        let writer = Arc::new(Writer::start(link)?);
        // It is tried again in a moment, and nobody shall wait for it meanwhile.
        let looking_after = connect(&at.clone().busy_timeout(Duration::ZERO))?;
        let upkeep = Upkeep::start(path, looking_after, Arc::downgrade(&writer))?;
        Ok(Self { upkeep, readers: Mutex::default(), writer, path: path.into(), reading: at.read_only(true) })
    }

    fn readers(&self) -> MutexGuard<'_, Vec<Link>> {
        self.readers.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Does `work` in the transaction of all who wait.
    fn run<T: Send + 'static>(
        &self,
        work: impl FnOnce(&mut Link) -> Result<T, Trouble> + Send + 'static,
    ) -> Result<T, CatalogError> {
        self.upkeep.note_write();
        self.writer.run(work)
    }
}

/// The file is made with its mode before, and never by who connects.
fn options(path: &Path) -> SqliteConnectOptions {
    // `file:` in front would be the scheme of a URL.
    let path = if path.is_relative() { Path::new(".").join(path) } else { path.to_owned() };
    SqliteConnectOptions::new().filename(path).busy_timeout(BUSY).disable_statement_logging()
}

fn connect(options: &SqliteConnectOptions) -> Result<Link, CatalogError> {
    Link::to_sqlite(options).map_err(explain)
}

fn explain(trouble: Trouble) -> CatalogError {
    trouble.explain(NAME)
}

impl Engine for SqliteCatalog {
    const REMOVED: (u32, u32) = (64, 4096);

    fn name(&self) -> &str {
        NAME
    }

    fn read<T>(&self, mut work: impl FnMut(&mut Link) -> Result<T, Trouble>) -> Result<T, CatalogError> {
        let kept = self.readers().pop();
        let mut link = kept.map_or_else(|| connect(&self.reading), Ok)?;
        let found = work(&mut link);
        // After an error it is opened anew.
        if found.is_ok() && self.readers().len() < READERS {
            self.readers().push(link);
        }
        found.map_err(explain)
    }

    fn write<T: Send + 'static>(
        &self,
        frees: bool,
        work: impl Fn(&mut Link) -> Result<T, Trouble> + Clone + Send + 'static,
    ) -> Result<T, CatalogError> {
        // On a full disk, what gives room takes what is kept for it.
        for _ in 0..if frees { RESERVE_TRIES } else { 0 } {
            match self.run(work.clone()) {
                // If it is not there, another deletion has just taken it for both, or it is being made anew.
                Err(CatalogError::Full) if !upkeep::give_reserve(&self.path) => std::thread::sleep(RESERVE_PAUSE),
                Err(CatalogError::Full) => {}
                outcome => return outcome,
            }
        }
        self.run(work)
    }

    fn store(&self, id: &str, chunks: Vec<Chunk>) -> Result<Vec<FrameEntry>, CatalogError> {
        let id = id.to_owned();
        self.run(move |link| {
            let number = session(link, &id)?;
            let mut stored = Vec::new();
            for Chunk { bytes, entries } in &chunks {
                let sql = "INSERT INTO chunks (record, bytes) VALUES ($1, $2) RETURNING number";
                let chunk = link.only(sql, &[Value::Integer(number), Value::Bytes(Some(bytes))])?;
                let placed =
                    entries.iter().map(|entry| FrameEntry { place: CagePlace { chunk, ..entry.place }, ..*entry });
                let first = stored.len();
                stored.extend(placed);
                put_frames(link, number, &id, &stored[first..])?;
            }
            let bytes: i64 = chunks.iter().map(Chunk::counted).sum();
            let sql = "UPDATE records SET frame_bytes = frame_bytes + $2 WHERE number = $1 AND phase <> $3";
            let values = [Value::Integer(number), Value::Integer(bytes), phase_value(Phase::Deleted)];
            if link.execute(sql, &values)? == 1 { Ok(stored) } else { Err(CatalogError::Gone.into()) }
        })
    }

    fn try_writing(&self) -> Result<(), CatalogError> {
        // Not noted for upkeep: it is asked for while nothing happens.
        self.writer.run(|link| {
            // A write that changes nothing would not be one.
            let version: i64 = link.only("PRAGMA user_version", &[])?;
            link.execute(AssertSqlSafe(format!("PRAGMA user_version = {version}")), &[]).map(drop)
        })
    }

    fn note_removal(&self) {
        self.upkeep.note_removal();
    }
}

/// Stores frames of `session`, whose record has this number, by one statement: each is a message to the thread of the
/// connection.
fn put_frames(link: &mut Link, number: i64, session: &str, entries: &[FrameEntry]) -> Result<(), Trouble> {
    let row = "(?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?)";
    let sql = format!("INSERT OR REPLACE INTO frames VALUES {}", vec![row; entries.len()].join(", "));
    let values = entries.iter().flat_map(|entry| {
        let FrameEntry { frame, place, l2, linf, squared, spread, handle_digest, full_digest } = entry;
        [
            Value::Integer(number),
            Value::Integer((*frame).into()),
            Value::Integer(place.chunk),
            Value::Integer(place.offset.into()),
            Value::Integer(place.bytes.into()),
            Value::Integer(place.crc.into()),
            Value::Real((*l2).into()),
            Value::Real((*linf).into()),
            Value::Real(*squared),
            Value::Real(*spread),
            Value::Bytes(Some(handle_digest)),
            Value::Bytes(full_digest.as_ref().map(|digest| &digest[..])),
            Value::Integer(checksums::of_entry(session, entry).into()),
        ]
    });
    link.execute(AssertSqlSafe(sql), &values.collect::<Vec<_>>()).map(drop)
}
