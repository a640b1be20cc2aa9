//! The frame log: solved frames in order of arrival, appended in groups; a group is acknowledged after it is durable.
//!
//! The acknowledged length is recorded twice: every record contains the durable length at the time it was written, and after each sync one
//! of two alternating marks in the first block is set to the new length. The mark is not synced by itself; it reaches the disk with the
//! next group at the latest. Invalid bytes below the largest recorded length are damage; invalid bytes beyond it are a torn write that was
//! never acknowledged, and are cut off.
//!
//! If a power cut loses the mark of the last group, later damage to that group is taken for a torn write. Opening the log therefore syncs
//! and marks everything that it finds.

use super::{Kind, LogRegistry, Store, StoreError};
use crate::store::disk::DiskFile;
use crate::store::files::timed;
use crate::sync::lock;
use format::{BLOCK_BYTES, Layout};
use std::fs::File;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};

mod format;
mod reader;
mod recovery;

#[cfg(test)]
pub(super) mod tests;

pub use reader::LogReader;

/// A solved frame.
#[derive(Clone, Copy, Debug)]
pub struct LogRecord<'a> {
    /// What the log says of it; appending sets the offset.
    pub entry: LogEntry,
    /// The cage, m × 3 interleaved.
    pub cage: &'a [f32],
}

/// A frame in the log, without its cage.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LogEntry {
    /// Number of the frame.
    pub frame: u32,
    /// Offset of its record in the file, in bytes.
    pub offset: u64,
    /// `sqrt(mean |e|²)`; NaN where it was not measured.
    pub l2: f32,
    /// `max |e|`; NaN where it was not measured.
    pub linf: f32,
    /// `Σ |e|²`.
    pub squared: f64,
    /// `Σ |p − p̄|²` of the frame about its own centroid.
    pub spread: f64,
    /// Digest of the handle rows received.
    pub handle_digest: [u8; 16],
    /// Digest of all rows; `None` if only handle rows were received.
    pub full_digest: Option<[u8; 16]>,
}

/// A session's log, open for appending.
#[derive(Debug)]
pub struct FrameLog {
    file: Arc<dyn DiskFile>,
    path: PathBuf,
    layout: Layout,
    /// Length up to which the file is durable; the file is longer only during an append.
    durable: u64,
    /// The durable bytes since the last multiple of [`BLOCK_BYTES`]: the next append writes to the same block.
    tail: Vec<u8>,
    /// Sequence number of the last mark, whose parity is its place; after reopening it starts from the parity alone.
    marks: u64,
    /// Set after an error that could not be undone; all further appends fail.
    poisoned: bool,
    buffer: Vec<u8>,
    only: WriterGuard,
}

/// Name of the file.
const LOG: &str = "frames.log";
/// Buffers larger than this are freed after an append.
const MAX_RETAINED_BUFFER_BYTES: usize = 4 << 20;

impl Store {
    /// Path of the session's log, whether or not it exists. For an invalid id it is a path where nothing exists.
    pub fn log_path(&self, id: &str) -> PathBuf {
        self.container_path(id).with_file_name(LOG)
    }

    /// Whether the session has a log.
    pub fn has_log(&self, id: &str) -> Result<bool, StoreError> {
        self.files().exists(&self.folder(Kind::Session, id)?.join(LOG))
    }

    /// Opens a session's log for cages of `rows` rows, creating it if it is missing; returns its frames in the order of the log, each once.
    /// All records are verified, a torn end is cut off, and everything returned is durable.
    ///
    /// # Errors
    /// [`StoreError::Damaged`] if acknowledged records are damaged or missing, or the log has cages of another size; the file is not
    /// changed then. `ResourceBusy` as [`StoreError::Io`] if the log is open already.
    pub fn open_log(&self, id: &str, rows: u32) -> Result<(FrameLog, Vec<LogEntry>), StoreError> {
        let (files, path) = (self.files(), self.folder(Kind::Session, id)?.join(LOG));
        let mut only = WriterGuard::new(self, id, &path)?;
        let layout = Layout::new(id, rows);
        if !files.exists(&path)? {
            // The first block is created atomically, so a log without it is damaged.
            files.replace(&path, &layout.first_block())?;
        }
        let file = files.disk.open_for_writing(&path).map_err(|e| StoreError::of(&path, "open", e))?;
        let recovered = recovery::recover(files, &*file, &path, &layout, only.needs_rewrite);
        only.needs_rewrite = recovered.is_err();
        let recovered = recovered?;
        let log = FrameLog {
            file,
            path,
            layout,
            durable: recovered.durable,
            tail: recovered.tail,
            marks: recovered.marks,
            poisoned: false,
            buffer: Vec::new(),
            only,
        };
        Ok((log, recovered.entries))
    }

    /// Opens a session's log for reading frames whose entries are known.
    ///
    /// # Errors
    /// [`StoreError::Damaged`] if it is missing or has cages of another size.
    pub fn log_reader(&self, id: &str, rows: u32) -> Result<LogReader, StoreError> {
        let path = self.folder(Kind::Session, id)?.join(LOG);
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

    /// Whether a failed sync may have lost data that reads still return; true until the log is reopened successfully.
    pub fn log_needs_rewrite(&self, id: &str) -> bool {
        lock(&self.inner.logs).needs_rewrite.contains(id)
    }
}

impl FrameLog {
    /// Appends records with one write and one sync; durable on `Ok`. After an error none of them is in the log; if the file cannot be
    /// restored, all further appends fail until the log is reopened.
    ///
    /// # Errors
    /// [`StoreError::Io`] with `InvalidInput` where a cage has another number of rows.
    pub fn append(&mut self, records: &[LogRecord<'_>]) -> Result<Vec<LogEntry>, StoreError> {
        if self.poisoned {
            let cause = io::Error::other("an earlier error could not be undone; the log has to be reopened");
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
            let entry = LogEntry { offset, ..record.entry };
            self.layout.write_record(&entry, record.cage, self.durable, &mut buffer);
            offset += self.layout.stride();
            entry
        });
        let entries: Vec<LogEntry> = entries.collect();
        let written = self.write(&buffer);
        if written.is_ok() {
            self.advance(&buffer);
        }
        buffer.shrink_to(MAX_RETAINED_BUFFER_BYTES);
        self.buffer = buffer;
        written.map(|()| entries)
    }

    /// A reader of the cages, independent of appends.
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
                self.poisoned = true;
                self.only.needs_rewrite = sync_failed;
                tracing::error!(%error, path = %self.path.display(), "a frame log rejects appends until it is reopened");
            }
            StoreError::of(&self.path, "append to", error)
        })
    }

    /// Removes a failed append from the file.
    fn cut_back(&mut self, sync_failed: bool) -> io::Result<()> {
        self.file.set_len(self.durable)?;
        if sync_failed {
            // After a failed sync the kernel may drop dirty pages and report them as clean. This also affects durable bytes that share a
            // block with new ones, and the first block with the marks: they are written again.
            self.file.write_all_at(&self.layout.first_block(), 0)?;
            self.layout.write_mark(&*self.file, self.marks, self.durable)?;
            self.file.write_all_at(&self.tail, self.durable - self.tail.len() as u64)?;
            timed(|| self.file.sync_data())?;
        }
        Ok(())
    }

    /// Updates the state after a successful sync.
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
        // The frames are durable even without the mark.
        if let Err(error) = self.layout.write_mark(&*self.file, self.marks, self.durable) {
            tracing::debug!(%error, path = %self.path.display(), "a frame log's length was not marked");
        }
    }
}

/// Registers the log as open, and keeps the store's lock.
#[derive(Debug)]
struct WriterGuard {
    id: String,
    logs: Arc<Mutex<LogRegistry>>,
    /// Whether a failed sync may have lost data that has not been written again. Survives the guard: it is stored in the registry on drop.
    needs_rewrite: bool,
    _lock: Arc<File>,
}

impl WriterGuard {
    fn new(store: &Store, id: &str, path: &Path) -> Result<Self, StoreError> {
        let logs = store.inner.logs.clone();
        let needs_rewrite = {
            let mut known = lock(&logs);
            if !known.open.insert(id.to_owned()) {
                return Err(StoreError::of(path, "open", io::ErrorKind::ResourceBusy.into()));
            }
            known.needs_rewrite.remove(id)
        };
        Ok(Self { id: id.to_owned(), logs, needs_rewrite, _lock: store.inner.lock.clone() })
    }
}

impl Drop for WriterGuard {
    fn drop(&mut self) {
        let mut known = lock(&self.logs);
        known.open.remove(&self.id);
        if self.needs_rewrite {
            known.needs_rewrite.insert(std::mem::take(&mut self.id));
        }
    }
}
