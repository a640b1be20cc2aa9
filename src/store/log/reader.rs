//! Reading cages from a frame log.

use super::format::{DATA_START, Layout};
use super::{LogEntry, StoreError};
use crate::store::disk::DiskFile;
use std::io;
use std::path::PathBuf;
use std::sync::Arc;

/// Adjacent records are read together, up to this many bytes.
const READ_BYTES: u64 = 1 << 20;

/// Reads cages; clones read the same file.
#[derive(Clone, Debug)]
pub struct LogReader {
    file: Arc<dyn DiskFile>,
    path: PathBuf,
    layout: Layout,
}

impl LogReader {
    pub(super) fn new(file: Arc<dyn DiskFile>, path: PathBuf, layout: Layout) -> Self {
        Self { file, path, layout }
    }

    /// Appends the cages of `entries` to `out`, each m × 3 `f32`, little-endian. On an error `out` is unchanged.
    ///
    /// # Errors
    /// [`StoreError::Damaged`] if a record fails its checksum.
    pub fn read_cages(&self, entries: &[LogEntry], out: &mut Vec<u8>) -> Result<(), StoreError> {
        let before = out.len();
        self.read(entries, out).inspect_err(|_| out.truncate(before))
    }

    fn read(&self, mut entries: &[LogEntry], out: &mut Vec<u8>) -> Result<(), StoreError> {
        let stride = self.layout.stride();
        let mut piece = Vec::new();
        while let Some(first) = entries.first() {
            let most = (READ_BYTES / stride).max(1) as usize;
            let adjacent = entries.iter().take(most).enumerate();
            let count = adjacent.take_while(|(i, entry)| entry.offset == first.offset + *i as u64 * stride).count();
            let (together, later) = entries.split_at(count);
            piece.resize(count * stride as usize, 0);
            if first.offset < DATA_START {
                return Err(self.damaged(first));
            }
            self.file.read_exact_at(&mut piece, first.offset).map_err(|error| match error.kind() {
                io::ErrorKind::UnexpectedEof => self.damaged(first),
                _ => StoreError::of(&self.path, "read", error),
            })?;
            for (entry, record) in together.iter().zip(piece.chunks_exact(stride as usize)) {
                match self.layout.read_record(record, entry.offset) {
                    Some((found, _)) if found.frame == entry.frame => out.extend_from_slice(self.layout.cage(record)),
                    _ => return Err(self.damaged(entry)),
                }
            }
            entries = later;
        }
        Ok(())
    }

    fn damaged(&self, entry: &LogEntry) -> StoreError {
        let LogEntry { frame, offset, .. } = entry;
        StoreError::damaged(&self.path, format!("the record of frame {frame} at byte {offset} is not what was written"))
    }
}
