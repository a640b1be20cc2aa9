//! The frame log: solved frames in order of arrival, appended in groups, each group durable before anyone hears of it.
//!
//! Two kinds of claims say which bytes were acknowledged. Every record tells how long the log was durable when it was written,
//! and after each sync one of two marks in the file's first block is set to the new length, without a sync of its own: it
//! is true whenever it is found, and reaches the disk with the next group at the latest. Bad bytes below a claim are damage; bad
//! bytes beyond every claim are the torn end of a group that nobody was told about, and are cut off.
//!
//! What was acknowledged last and lost its mark to a power cut cannot be told from a torn end if it is damaged later, before
//! the log is opened again. Opening makes all that it finds durable and marks it.

use super::names::check_id;
use super::{Logs, Store, StoreError};
use crate::store::disk::DiskFile;
use crate::store::files::timed;
use format::{BLOCK_BYTES, Layout};
use std::fs::File;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

mod format;
mod reader;
mod recovery;

#[cfg(test)]
pub(super) mod tests;

pub use reader::LogReader;

/// A solved frame.
#[derive(Clone, Copy, Debug)]
pub struct LogRecord<'a> {
    /// Number of the frame.
    pub frame: u32,
    /// `sqrt(mean |e|²)`; NaN where it was not measured.
    pub l2: f32,
    /// `max |e|`; NaN where it was not measured.
    pub linf: f32,
    /// `Σ |e|²`.
    pub squared: f64,
    /// `Σ |p − p̄|²` of the frame about its own centroid.
    pub spread: f64,
    /// Digest of the handle rows that came.
    pub handle_digest: [u8; 16],
    /// Digest of the whole frame; None where only handle rows came.
    pub full_digest: Option<[u8; 16]>,
    /// The cage, m × 3 interleaved.
    pub cage: &'a [f32],
}

/// A frame in the log, without its cage.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LogEntry {
    /// Number of the frame.
    pub frame: u32,
    /// Where its record begins, in bytes.
    pub offset: u64,
    /// `sqrt(mean |e|²)`; NaN where it was not measured.
    pub l2: f32,
    /// `max |e|`; NaN where it was not measured.
    pub linf: f32,
    /// `Σ |e|²`.
    pub squared: f64,
    /// `Σ |p − p̄|²` of the frame about its own centroid.
    pub spread: f64,
    /// Digest of the handle rows that came.
    pub handle_digest: [u8; 16],
    /// Digest of the whole frame; None where only handle rows came.
    pub full_digest: Option<[u8; 16]>,
}

/// A session's log, open for appending.
#[derive(Debug)]
pub struct FrameLog {
    file: Arc<dyn DiskFile>,
    path: PathBuf,
    layout: Layout,
    /// Bytes that are durable; the file has more only during an append.
    durable: u64,
    /// The durable bytes since the last multiple of [`BLOCK_BYTES`]: an append shares their block.
    tail: Vec<u8>,
    /// Marks set so far: they alternate between two places.
    marks: u64,
    /// After an error that could not be undone.
    refuses: bool,
    buffer: Vec<u8>,
    only: OnlyWriter,
}

/// Larger buffers are given back after an append.
const KEPT_BUFFER_BYTES: usize = 4 << 20;

impl Store {
    /// Where the session's log lies, or would. A name that is no id gives a path where nothing is.
    pub fn log_path(&self, id: &str) -> PathBuf {
        self.container_path(id).with_file_name("frames.log")
    }

    /// Whether the session has a log.
    ///
    /// # Errors
    /// [`StoreError::BadId`], or what the system says.
    pub fn has_log(&self, id: &str) -> Result<bool, StoreError> {
        check_id(id)?;
        self.files().exists(&self.log_path(id))
    }

    /// Opens a session's log, made where it is missing, for cages of `rows` rows; gives the frames in it, in the log's order,
    /// each once. Every record is checked, a torn end is cut off, and all that is given is durable.
    ///
    /// # Errors
    /// [`StoreError::Damaged`] where acknowledged records are damaged or missing, or the log is of other cages; nothing is
    /// changed then. `ResourceBusy` as [`StoreError::Io`] where the log is open already. [`StoreError::BadId`].
    pub fn open_log(&self, id: &str, rows: u32) -> Result<(FrameLog, Vec<LogEntry>), StoreError> {
        check_id(id)?;
        let files = self.files();
        let path = files.session(id).join("frames.log");
        let mut only = OnlyWriter::new(self, id, &path)?;
        let layout = Layout::new(id, rows);
        if !files.exists(&path)? {
            // The first block appears whole, so a log without one is damaged.
            files.replace(&path, &layout.first_block())?;
        }
        let file = files.disk.open_for_writing(&path).map_err(|e| StoreError::of(&path, "open", e))?;
        let recovered = recovery::recover(files, &*file, &path, &layout, only.doubtful);
        only.doubtful = recovered.is_err();
        let recovered = recovered?;
        let log = FrameLog {
            file,
            path,
            layout,
            durable: recovered.durable,
            tail: recovered.tail,
            marks: recovered.marks,
            refuses: false,
            buffer: Vec::new(),
            only,
        };
        Ok((log, recovered.entries))
    }
}

impl Store {
    /// Opens a session's log for reading frames that are known to be in it.
    ///
    /// # Errors
    /// [`StoreError::Damaged`] where it is gone or of other cages, [`StoreError::BadId`], or what the system says.
    pub fn log_reader(&self, id: &str, rows: u32) -> Result<LogReader, StoreError> {
        check_id(id)?;
        let path = self.log_path(id);
        let file = self.files().disk.open(&path).map_err(|error| match error.kind() {
            io::ErrorKind::NotFound => StoreError::damaged(&path, "the frame log is gone".to_owned()),
            _ => StoreError::of(&path, "open", error),
        })?;
        let layout = Layout::new(id, rows);
        let mut block = vec![0; format::DATA_START as usize];
        file.read_exact_at(&mut block, 0).map_err(|error| match error.kind() {
            io::ErrorKind::UnexpectedEof => StoreError::damaged(&path, "its first block is cut".to_owned()),
            _ => StoreError::of(&path, "read", error),
        })?;
        layout.check_first_block(&block).map_err(|what| StoreError::damaged(&path, what))?;
        Ok(LogReader::new(file, path, layout))
    }

    /// Whether the disk may hold less of a session's log than the system shows, until the log is opened again with success.
    pub fn log_is_doubtful(&self, id: &str) -> bool {
        self.inner.logs.lock().unwrap_or_else(PoisonError::into_inner).doubtful.contains(id)
    }
}

impl FrameLog {
    /// Appends records with one write and one sync for all; on Ok they are durable. On an error none of them is in the log; where
    /// even that could not be reached, the log refuses all further appends until it is opened anew.
    ///
    /// # Errors
    /// [`StoreError::Full`]; [`StoreError::Io`] with `InvalidInput` where a cage has another number of rows.
    pub fn append(&mut self, records: &[LogRecord<'_>]) -> Result<Vec<LogEntry>, StoreError> {
        if self.refuses {
            let cause = io::Error::other("an earlier error could not be undone; it has to be opened anew");
            return Err(StoreError::of(&self.path, "append to", cause));
        }
        if records.is_empty() {
            return Ok(Vec::new());
        }
        if records.iter().any(|record| record.cage.len() != self.layout.cage_values()) {
            let cause = io::Error::new(io::ErrorKind::InvalidInput, "a cage has another number of rows");
            return Err(StoreError::of(&self.path, "append to", cause));
        }
        let mut buffer = std::mem::take(&mut self.buffer);
        buffer.clear();
        let mut offset = self.durable;
        let entries = records.iter().map(|record| {
            self.layout.write_record(record, self.durable, offset, &mut buffer);
            let entry = record.entry(offset);
            offset += self.layout.stride();
            entry
        });
        let entries: Vec<LogEntry> = entries.collect();
        let written = self.write(&buffer);
        if written.is_ok() {
            self.advance(&buffer);
        }
        buffer.shrink_to(KEPT_BUFFER_BYTES);
        self.buffer = buffer;
        written.map(|()| entries)
    }

    /// Reads the cages back; independent of appends.
    pub fn reader(&self) -> LogReader {
        LogReader::new(self.file.clone(), self.path.clone(), self.layout)
    }

    fn write(&mut self, bytes: &[u8]) -> Result<(), StoreError> {
        let mut sync_failed = false;
        let result = self
            .file
            .write_all_at(bytes, self.durable)
            .and_then(|()| timed(|| self.file.sync_data()).inspect_err(|_| sync_failed = true));
        result.map_err(|error| {
            if let Err(error) = self.cut_back(sync_failed) {
                self.refuses = true;
                self.only.doubtful = sync_failed;
                tracing::error!(%error, path = %self.path.display(), "a frame log takes no more frames until it is opened anew");
            }
            StoreError::of(&self.path, "append to", error)
        })
    }

    /// Takes a failed append out of the file again.
    fn cut_back(&mut self, sync_failed: bool) -> io::Result<()> {
        self.file.set_len(self.durable)?;
        if sync_failed {
            // The system may have dropped what it could not write, and calls it written. That includes durable bytes in the same
            // block as the first new ones, and in the first block, which has the marks: they are written once more.
            self.file.write_all_at(&self.layout.first_block(), 0)?;
            self.layout.write_mark(&*self.file, self.marks, self.durable)?;
            self.file.write_all_at(&self.tail, self.durable - self.tail.len() as u64)?;
            timed(|| self.file.sync_data())?;
        }
        Ok(())
    }

    /// After a sync.
    fn advance(&mut self, bytes: &[u8]) {
        let before = self.durable;
        self.durable += bytes.len() as u64;
        let block = self.durable - self.durable % BLOCK_BYTES;
        if block >= before {
            self.tail.clear();
            self.tail.extend_from_slice(&bytes[(block - before) as usize..]);
        } else {
            self.tail.extend_from_slice(bytes);
        }
        metrics::counter!("cager_log_bytes_total").increment(bytes.len() as u64);
        self.marks += 1;
        // The frames are durable with or without it.
        if let Err(error) = self.layout.write_mark(&*self.file, self.marks, self.durable) {
            tracing::debug!(%error, path = %self.path.display(), "a frame log's length was not marked");
        }
    }
}

impl LogRecord<'_> {
    fn entry(&self, offset: u64) -> LogEntry {
        let Self { frame, l2, linf, squared, spread, handle_digest, full_digest, cage: _ } = *self;
        LogEntry { frame, offset, l2, linf, squared, spread, handle_digest, full_digest }
    }
}

/// Holds the session's place among the open logs, and the store's lock.
#[derive(Debug)]
struct OnlyWriter {
    id: String,
    logs: Arc<Mutex<Logs>>,
    /// Whether the disk may hold something else than the system shows: a sync failed, and what it may have ruined was not
    /// written again. Outlives this.
    doubtful: bool,
    _lock: Arc<File>,
}

impl OnlyWriter {
    fn new(store: &Store, id: &str, path: &Path) -> Result<Self, StoreError> {
        let logs = store.inner.logs.clone();
        let doubtful = {
            let mut known = logs.lock().unwrap_or_else(PoisonError::into_inner);
            if !known.open.insert(id.to_owned()) {
                return Err(StoreError::of(path, "open", io::ErrorKind::ResourceBusy.into()));
            }
            known.doubtful.remove(id)
        };
        Ok(Self { id: id.to_owned(), logs, doubtful, _lock: store.inner.lock.clone() })
    }
}

impl Drop for OnlyWriter {
    fn drop(&mut self) {
        let mut known = self.logs.lock().unwrap_or_else(PoisonError::into_inner);
        known.open.remove(&self.id);
        if self.doubtful {
            known.doubtful.insert(std::mem::take(&mut self.id));
        }
    }
}
