//! Recovery of a frame log when it is opened: verifies its records, cuts a torn end off, and makes the rest durable.

use super::format::{BLOCK_BYTES, DATA_START, Layout};
use super::{LogEntry, StoreError};
use crate::store::disk::DiskFile;
use crate::store::files::{Files, parent};
use std::collections::HashMap;
use std::path::Path;

/// Bytes read at a time.
const READ_BYTES: u64 = 1 << 20;

pub(super) struct Recovered {
    pub(super) entries: Vec<LogEntry>,
    /// Length of the log; all of it is durable.
    pub(super) durable: u64,
    /// Its bytes since the last multiple of [`BLOCK_BYTES`].
    pub(super) tail: Vec<u8>,
    pub(super) marks: u64,
}

pub(super) fn recover(
    files: &Files,
    file: &dyn DiskFile,
    path: &Path,
    layout: &Layout,
    needs_rewrite: bool,
) -> Result<Recovered, StoreError> {
    let failed = |error| StoreError::of(path, "read", error);
    let length = file.length().map_err(failed)?;
    if length < DATA_START {
        return Err(StoreError::damaged(path, format!("{length} bytes are too few for its first block")));
    }
    let mut block = vec![0; DATA_START as usize];
    file.read_exact_at(&mut block, 0).map_err(failed)?;
    layout.check_first_block(&block).map_err(|what| StoreError::damaged(path, what))?;
    let (marked, mut marks) = layout.marked(&block);

    let Scan { entries, end, claimed } = scan(file, length, layout).map_err(failed)?;
    let claimed = claimed.max(marked).max(DATA_START);
    if claimed > end {
        let what = if length < claimed && end + layout.stride() > length {
            format!("{length} bytes are left of {claimed} that were acknowledged")
        } else {
            format!("the record at byte {end} was acknowledged and does not match its checksum")
        };
        return Err(StoreError::damaged(path, what));
    }
    if end < length {
        tracing::info!(path = %path.display(), bytes = length - end, "the torn end of a frame log is cut off");
        file.set_len(end).map_err(|e| StoreError::of(path, "cut the torn end of", e))?;
    }
    let tail = read_range(file, end - end % BLOCK_BYTES, end).map_err(failed)?;
    if end == DATA_START {
        // The folder entry may not be durable yet, and later appends rely on it.
        files.sync_dir(parent(path))?;
    }
    if claimed < end || needs_rewrite {
        // These records may never have been synced, or their sync failed and would not be reported again. Writing them again makes them
        // dirty, so that they can be synced. The same goes for the first block, and for the durable bytes in the same block as the first of them.
        let failed = |error| StoreError::of(path, "write", error);
        file.write_all_at(&block, 0).map_err(failed)?;
        let mut at = claimed - claimed % BLOCK_BYTES;
        while at < end {
            let piece = read_range(file, at, end.min(at + READ_BYTES)).map_err(failed)?;
            file.write_all_at(&piece, at).map_err(failed)?;
            at += piece.len() as u64;
        }
        files.sync_file(file, path)?;
        files.sync_dir(parent(path))?;
        marks += 1;
        if let Err(error) = layout.write_mark(file, marks, end) {
            tracing::debug!(%error, path = %path.display(), "a frame log's length was not marked");
        }
    }
    let mut known: HashMap<u32, usize> = HashMap::with_capacity(entries.len());
    let mut kept: Vec<LogEntry> = Vec::with_capacity(entries.len());
    for entry in entries {
        let place = *known.entry(entry.frame).or_insert(kept.len());
        match kept.get_mut(place) {
            None => kept.push(entry),
            Some(first) if first.full_digest.is_none() && entry.full_digest.is_some() => *first = entry,
            Some(_) => {}
        }
    }
    let entries = kept;
    Ok(Recovered { entries, durable: end, tail, marks })
}

struct Scan {
    /// Records before the first invalid one.
    entries: Vec<LogEntry>,
    /// Offset of the first invalid record, or the end of the last complete one.
    end: u64,
    /// Largest durable length recorded by any valid record, including those after `end`.
    claimed: u64,
}

fn scan(file: &dyn DiskFile, length: u64, layout: &Layout) -> std::io::Result<Scan> {
    let stride = layout.stride();
    let together = (READ_BYTES / stride).max(1);
    let mut piece = Vec::new();
    let mut found = Scan { entries: Vec::new(), end: DATA_START, claimed: 0 };
    let mut intact = true;
    let mut at = DATA_START;
    while at + stride <= length {
        let count = together.min((length - at) / stride);
        piece.resize((count * stride) as usize, 0);
        file.read_exact_at(&mut piece, at)?;
        for record in piece.chunks_exact(stride as usize) {
            let read = layout.read_record(record, at);
            at += stride;
            match read {
                Some((entry, claim)) => {
                    found.claimed = found.claimed.max(claim);
                    if intact {
                        found.entries.push(entry);
                        found.end = at;
                    }
                }
                None => intact = false,
            }
        }
    }
    Ok(found)
}

fn read_range(file: &dyn DiskFile, from: u64, to: u64) -> std::io::Result<Vec<u8>> {
    let mut bytes = vec![0; (to - from) as usize];
    file.read_exact_at(&mut bytes, from)?;
    Ok(bytes)
}
