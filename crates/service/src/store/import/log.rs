//! The frame log of earlier versions, all numbers little-endian.
//!
//! ```text
//! first block, 4096 bytes:
//!   0     magic [u8; 8]   version u32   rows u32   session id [u8; 64], zero-padded   crc32c u32 of these 80 bytes
//!   512   mark: durable length u64   crc32c u32 of it
//!   1024  the other mark
//! records, each of the same length:
//!   frame u32   flags u32 (1: there is a full digest)   l2 f32   linf f32   squared f64   spread f64
//!   durable u64   handle digest [u8; 16]   full digest [u8; 16]   cage [f32; 3 * rows]   crc32c u32
//! ```
//!
//! The CRC of the header is the initial value of all other CRCs, and that of a record includes its offset. What is not valid below the largest durable
//! length that is said anywhere is damage; what is not valid beyond it was never acknowledged.

use crate::store::disk::DiskFile;
use crate::store::files::Files;
use crate::store::{CagePlace, FrameEntry, NewFrame, StoreError};
use std::path::{Path, PathBuf};
use std::sync::Arc;

const MAGIC: [u8; 8] = *b"CGRLOG\r\n";
const VERSION: u32 = 1;
const BLOCK_BYTES: u64 = 4096;
const HEADER_BYTES: usize = 80;
const MARKS: [usize; 2] = [512, 1024];
const FIXED_BYTES: usize = 72;
const HAS_FULL_DIGEST: u32 = 1;

/// A log whose first block is whole.
pub(super) struct Log {
    file: Arc<dyn DiskFile>,
    path: PathBuf,
    bytes: u64,
    seed: u32,
    rows: u32,
    /// Length up to which it was acknowledged, as its marks say.
    marked: u64,
}

impl Log {
    /// Opens the log of a session; `None` if there is none.
    ///
    /// # Errors
    /// [`StoreError::Damaged`] where its first block is.
    pub(super) fn open(files: &Files, path: &Path, session: &str) -> Result<Option<Self>, StoreError> {
        let Some(file) = files.open(path)? else { return Ok(None) };
        let failed = |e| StoreError::of(path, "read", e);
        let bytes = file.length().map_err(failed)?;
        if bytes < BLOCK_BYTES {
            return Err(StoreError::damaged(path, format!("{bytes} bytes are too few for its first block")));
        }
        let mut block = vec![0; BLOCK_BYTES as usize];
        file.read_exact_at(&mut block, 0).map_err(failed)?;
        let seed = crc32c::crc32c(&block[..HEADER_BYTES]);
        let mut expected = [0; 64];
        expected[..session.len()].copy_from_slice(session.as_bytes());
        if u32_at(&block, HEADER_BYTES) != seed || block[..8] != MAGIC || u32_at(&block, 8) != VERSION {
            return Err(StoreError::damaged(path, "its header does not match its checksum"));
        }
        if block[16..HEADER_BYTES] != expected {
            return Err(StoreError::damaged(path, "it belongs to another session"));
        }
        let mark = |at: usize| {
            let is_whole = u32_at(&block, at + 8) == crc32c::crc32c_append(seed, &block[at..at + 8]);
            if is_whole { u64_at(&block, at) } else { 0 }
        };
        let marked = MARKS.map(mark).into_iter().max().unwrap_or(0);
        Ok(Some(Self { file, path: path.to_owned(), bytes, seed, rows: u32_at(&block, 12), marked }))
    }

    /// Reads all valid frames in order, at most `most` at a time.
    ///
    /// # Errors
    /// Those of `take`; [`StoreError::Damaged`] where acknowledged frames are damaged or missing, after those before it.
    pub(super) fn read(
        &self,
        most: usize,
        mut take: impl FnMut(&[NewFrame<'_>]) -> Result<(), StoreError>,
    ) -> Result<(), StoreError> {
        let stride = FIXED_BYTES as u64 + 12 * u64::from(self.rows) + 4;
        let (mut at, mut end, mut acknowledged) = (BLOCK_BYTES, BLOCK_BYTES, self.marked);
        let mut piece = Vec::new();
        while at + stride <= self.bytes {
            let count = (most as u64).min((self.bytes - at) / stride);
            piece.resize((count * stride) as usize, 0);
            self.file.read_exact_at(&mut piece, at).map_err(|e| StoreError::of(&self.path, "read", e))?;
            let mut found = Vec::new();
            for record in piece.chunks_exact(stride as usize) {
                if let Some((entry, cage, said)) = self.record(record, at) {
                    acknowledged = acknowledged.max(said);
                    if end == at {
                        end = at + stride;
                        found.push((entry, cage));
                    }
                }
                at += stride;
            }
            let frames: Vec<NewFrame<'_>> =
                found.iter().map(|(entry, cage)| NewFrame { entry: *entry, cage }).collect();
            if !frames.is_empty() {
                take(&frames)?;
            }
        }
        if acknowledged > end {
            let what =
                format!("the record at byte {end} was acknowledged and is missing or does not match its checksum");
            return Err(StoreError::damaged(&self.path, what));
        }
        Ok(())
    }

    /// The frame in a record, its cage, and the durable length that it says; `None` if it is not valid.
    fn record(&self, record: &[u8], offset: u64) -> Option<(FrameEntry, Vec<f32>, u64)> {
        let (body, crc) = record.split_last_chunk::<4>()?;
        let sum = crc32c::crc32c_append(crc32c::crc32c_append(self.seed, &offset.to_le_bytes()), body);
        if sum.to_le_bytes() != *crc {
            return None;
        }
        let entry = FrameEntry {
            frame: u32_at(body, 0),
            place: CagePlace::default(),
            l2: f32::from_bits(u32_at(body, 8)),
            linf: f32::from_bits(u32_at(body, 12)),
            squared: f64::from_bits(u64_at(body, 16)),
            spread: f64::from_bits(u64_at(body, 24)),
            handle_digest: std::array::from_fn(|i| body[40 + i]),
            full_digest: (u32_at(body, 4) & HAS_FULL_DIGEST != 0).then(|| std::array::from_fn(|i| body[56 + i])),
        };
        let cage = body[FIXED_BYTES..].as_chunks().0.iter().map(|&b| f32::from_le_bytes(b)).collect();
        Some((entry, cage, u64_at(body, 32)))
    }
}

fn u32_at(bytes: &[u8], at: usize) -> u32 {
    u32::from_le_bytes(std::array::from_fn(|i| bytes[at + i]))
}

fn u64_at(bytes: &[u8], at: usize) -> u64 {
    u64::from_le_bytes(std::array::from_fn(|i| bytes[at + i]))
}
