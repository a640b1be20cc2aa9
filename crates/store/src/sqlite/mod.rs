//! The catalogue in one SQLite file, for one process at a time.

mod rows;
#[cfg(test)]
mod tests;
mod upkeep;
mod writer;

use crate::chunks::{Chunk, add_cage, chunks, lost};
use crate::numbers::{kind_number, phase_number};
use crate::{CagePlace, Catalog, CatalogError, Change, FrameEntry, Key, NewFrame, NewRecord, Phase, Record};
use rusqlite::{Connection, OpenFlags, OptionalExtension as _, params};
use std::fs::OpenOptions;
use std::os::unix::fs::OpenOptionsExt as _;
use std::path::Path;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;
use upkeep::Upkeep;
use writer::Writer;

/// Version of the tables.
const VERSION: i64 = 1;
/// Chunks of a removed record that are removed in one transaction, between which others can write.
const REMOVED_CHUNKS: u32 = 64;
/// As [`REMOVED_CHUNKS`], for what is known of frames.
const REMOVED_FRAMES: u32 = 4096;
/// Pages of 4 KiB in the log from which on who writes writes it back.
const LOG_PAGES: u32 = (upkeep::RESERVE / 2 / 4096) as u32;
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
    readers: Mutex<Vec<Connection>>,
    writer: Arc<Writer>,
    path: Box<Path>,
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
        let connection = connect(path)?;
        // Only effective before the first table.
        connection.pragma_update(None, "auto_vacuum", "INCREMENTAL")?;
        connection.pragma_update(None, "journal_mode", "WAL")?;
        connection.pragma_update(None, "synchronous", "FULL")?;
        // Another thread does it before, unless much is written: what the log alone holds must fit the reserve, or a full disk stays full.
        connection.pragma_update(None, "wal_autocheckpoint", LOG_PAGES)?;
        let version: i64 = connection.pragma_query_value(None, "user_version", |row| row.get(0))?;
        match version {
            0 => {
                let schema = include_str!("schema.sql");
                connection.execute_batch(&format!("BEGIN; {schema} PRAGMA user_version = {VERSION}; COMMIT;"))?;
            }
            VERSION => {}
            newer => return Err(CatalogError::Newer { found: newer, known: VERSION }),
        }
        let writer = Arc::new(Writer::start(connection)?);
        let looking_after = connect(path)?;
        // It is tried again in a moment, and nobody shall wait for it meanwhile.
        looking_after.busy_timeout(Duration::ZERO)?;
        let upkeep = Upkeep::start(path, looking_after, Arc::downgrade(&writer))?;
        Ok(Self { upkeep, readers: Mutex::default(), writer, path: path.into() })
    }

    fn readers(&self) -> MutexGuard<'_, Vec<Connection>> {
        self.readers.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn read<T>(&self, work: impl FnOnce(&Connection) -> Result<T, CatalogError>) -> Result<T, CatalogError> {
        let kept = self.readers().pop();
        let connection = kept.map_or_else(|| connect(&self.path), Ok)?;
        let found = work(&connection);
        // After an error it is opened anew.
        if found.is_ok() && self.readers().len() < READERS {
            self.readers().push(connection);
        }
        found
    }

    fn write<T: Send + 'static>(
        &self,
        work: impl FnOnce(&Connection) -> Result<T, CatalogError> + Send + 'static,
    ) -> Result<T, CatalogError> {
        self.upkeep.note_write();
        self.writer.run(work)
    }

    /// As [`Self::write`], for what gives room: on a full disk it takes what is kept for it.
    fn write_to_free<T: Send + 'static>(
        &self,
        work: impl Fn(&Connection) -> Result<T, CatalogError> + Clone + Send + 'static,
    ) -> Result<T, CatalogError> {
        for _ in 0..RESERVE_TRIES {
            match self.write(work.clone()) {
                // If it is not there, another deletion has just taken it for both, or it is being made anew.
                Err(CatalogError::Full) if !upkeep::give_reserve(&self.path) => std::thread::sleep(RESERVE_PAUSE),
                Err(CatalogError::Full) => {}
                outcome => return outcome,
            }
        }
        self.write(work)
    }
}

fn connect(path: &Path) -> Result<Connection, CatalogError> {
    // The file is made with its mode before, and never by who reads.
    let connection =
        Connection::open_with_flags(path, OpenFlags::SQLITE_OPEN_READ_WRITE | OpenFlags::SQLITE_OPEN_NO_MUTEX)?;
    connection.busy_timeout(BUSY)?;
    Ok(connection)
}

/// Number of the row of a record; `None` if the record does not exist.
fn number(connection: &Connection, key: Key<'_>) -> Result<Option<i64>, CatalogError> {
    let mut statement = connection.prepare_cached("SELECT number FROM records WHERE kind = ?1 AND id = ?2")?;
    Ok(statement.query_row(params![kind_number(key.kind), key.id], |row| row.get(0)).optional()?)
}

/// Number of a session.
fn session(connection: &Connection, id: &str) -> Result<i64, CatalogError> {
    number(connection, Key { kind: crate::Kind::Session, id })?.ok_or(CatalogError::Gone)
}

impl Catalog for SqliteCatalog {
    fn create(&self, record: NewRecord<'_>) -> Result<(), CatalogError> {
        let (kind, id, phase) = (record.key.kind, record.key.id.to_owned(), phase_number(record.phase));
        let (created_ms, meta) = (record.created_ms as i64, record.meta.to_vec());
        self.write(move |connection| {
            if number(connection, Key { kind, id: &id })?.is_some() {
                return Err(CatalogError::Taken);
            }
            let sql = "INSERT INTO records (kind, id, created_ms, phase, meta) VALUES (?1, ?2, ?3, ?4, ?5)";
            connection.prepare_cached(sql)?.execute(params![kind_number(kind), id, created_ms, phase, meta])?;
            Ok(())
        })
    }

    fn record(&self, key: Key<'_>) -> Result<Option<Record>, CatalogError> {
        self.read(|connection| {
            let mut statement = connection.prepare_cached(&format!("{} WHERE kind = ?1 AND id = ?2", rows::RECORD))?;
            Ok(statement.query_row(params![kind_number(key.kind), key.id], rows::record).optional()?)
        })
    }

    fn records(&self) -> Result<Vec<Record>, CatalogError> {
        self.read(|connection| {
            let mut statement = connection.prepare(&format!("{} ORDER BY created_ms, id", rows::RECORD))?;
            let mut found = statement.query([])?;
            let mut records = Vec::new();
            while let Some(row) = found.next()? {
                match rows::record(row) {
                    Ok(record) => records.push(record),
                    // It stays, and blocks nobody.
                    Err(error) => tracing::error!(record = rows::identity(row), %error, "a damaged record is left out"),
                }
            }
            Ok(records)
        })
    }

    fn change(&self, key: Key<'_>, changes: &[Change]) -> Result<bool, CatalogError> {
        let (kind, id, changes) = (key.kind, key.id.to_owned(), changes.to_vec());
        let frees = changes.contains(&Change::Phase(Phase::Deleted));
        let work = move |connection: &Connection| {
            let Some(number) = number(connection, Key { kind, id: &id })? else { return Ok(false) };
            changes.iter().try_for_each(|change| rows::change(connection, number, change))?;
            Ok(true)
        };
        if frees { self.write_to_free(work) } else { self.write(work) }
    }

    fn remove(&self, key: Key<'_>) -> Result<(), CatalogError> {
        let kind = key.kind;
        loop {
            let id = key.id.to_owned();
            let is_gone = self.write_to_free(move |connection| {
                let Some(number) = number(connection, Key { kind, id: &id })? else { return Ok(true) };
                let some = "DELETE FROM chunks WHERE number IN (SELECT number FROM chunks WHERE record = ?1 LIMIT ?2)";
                if connection.prepare_cached(some)?.execute(params![number, REMOVED_CHUNKS])? > 0 {
                    return Ok(false);
                }
                let some = "DELETE FROM frames WHERE record = ?1 AND frame IN (SELECT frame FROM frames WHERE record = ?1 LIMIT ?2)";
                if connection.prepare_cached(some)?.execute(params![number, REMOVED_FRAMES])? > 0 {
                    return Ok(false);
                }
                connection.execute("DELETE FROM records WHERE number = ?1", [number])?;
                Ok(true)
            });
            if is_gone? {
                self.upkeep.note_removal();
                return Ok(());
            }
        }
    }

    fn append(&self, id: &str, frames: &[NewFrame<'_>]) -> Result<Vec<FrameEntry>, CatalogError> {
        let chunks = chunks(id, frames);
        let id = id.to_owned();
        self.write(move |connection| {
            let number = session(connection, &id)?;
            let mut stored = Vec::new();
            for Chunk { bytes, entries } in &chunks {
                let sql = "INSERT INTO chunks (record, bytes) VALUES (?1, ?2)";
                connection.prepare_cached(sql)?.execute(params![number, bytes])?;
                let chunk = connection.last_insert_rowid();
                for entry in entries {
                    let entry = FrameEntry { place: CagePlace { chunk, ..entry.place }, ..*entry };
                    rows::put_frame(connection, number, &id, &entry)?;
                    stored.push(entry);
                }
            }
            let bytes: i64 = chunks.iter().map(Chunk::counted).sum();
            let sql = "UPDATE records SET frame_bytes = frame_bytes + ?2 WHERE number = ?1 AND phase <> ?3";
            let grown = connection.prepare_cached(sql)?;
            let is_there = { grown }.execute(params![number, bytes, phase_number(Phase::Deleted)])? == 1;
            if is_there { Ok(stored) } else { Err(CatalogError::Gone) }
        })
    }

    fn frames(&self, id: &str) -> Result<Vec<FrameEntry>, CatalogError> {
        self.read(|connection| {
            let number = session(connection, id)?;
            let mut statement = connection.prepare_cached(rows::FRAME)?;
            let mut found = statement.query([number])?;
            let mut frames = Vec::new();
            while let Some(row) = found.next()? {
                frames.push(rows::frame(id, row)?);
            }
            Ok(frames)
        })
    }

    fn cages(&self, id: &str, frames: &[FrameEntry], out: &mut Vec<u8>) -> Result<(), CatalogError> {
        let before = out.len();
        let read = self.read(|connection| {
            let number = session(connection, id)?;
            let mut statement =
                connection.prepare_cached("SELECT bytes FROM chunks WHERE number = ?1 AND record = ?2")?;
            for together in frames.chunk_by(|a, b| a.place.chunk == b.place.chunk) {
                let found = statement.query_row(params![together[0].place.chunk, number], |row| {
                    let chunk = row.get_ref(0)?.as_blob()?;
                    Ok(together.iter().try_for_each(|entry| add_cage(id, entry, chunk, 0, out)))
                });
                found.optional()?.unwrap_or_else(|| Err(lost(&together[0])))?;
            }
            Ok(())
        });
        read.inspect_err(|_| out.truncate(before))
    }

    fn probe(&self) -> Result<(), CatalogError> {
        // Not noted for upkeep: it is asked for while nothing happens.
        self.writer.run(|connection| {
            // A write that changes nothing would not be one.
            connection.pragma_update(None, "user_version", VERSION)?;
            Ok(())
        })
    }
}
