//! The bytes of a frame log, all numbers little-endian.
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
//! The CRC of the header is the initial value of all other CRCs, and that of a record includes its offset, so a record of another session
//! or from another offset fails its checksum. Each mark lies in a sector of its own: a torn write of one affects neither the header nor the
//! other mark.

use super::LogEntry;
use crate::store::disk::DiskFile;
use std::io;

pub(super) const MAGIC: [u8; 8] = *b"CGRLOG\r\n";
const VERSION: u32 = 1;
const HEADER_BYTES: usize = 84;
/// Where the records begin.
pub(super) const DATA_START: u64 = 4096;
/// Size of the blocks in which the file system writes.
pub(super) const BLOCK_BYTES: u64 = 4096;
const MARKS: [u64; 2] = [512, 1024];
const MARK_BYTES: usize = 12;
const FIXED_BYTES: usize = 72;
const HAS_FULL_DIGEST: u32 = 1;

/// Layout of one session's log.
#[derive(Clone, Copy, Debug)]
pub(super) struct Layout {
    header: [u8; HEADER_BYTES],
    rows: u32,
    seed: u32,
}

impl Layout {
    /// The caller has checked the id.
    pub(super) fn new(id: &str, rows: u32) -> Self {
        let mut header = [0; HEADER_BYTES];
        header[..8].copy_from_slice(&MAGIC);
        header[8..12].copy_from_slice(&VERSION.to_le_bytes());
        header[12..16].copy_from_slice(&rows.to_le_bytes());
        header[16..16 + id.len()].copy_from_slice(id.as_bytes());
        let seed = crc32c::crc32c(&header[..80]);
        header[80..].copy_from_slice(&seed.to_le_bytes());
        Self { header, rows, seed }
    }

    pub(super) fn cage_values(&self) -> usize {
        3 * self.rows as usize
    }

    fn cage_bytes(&self) -> usize {
        4 * self.cage_values()
    }

    /// Bytes of a record.
    pub(super) fn stride(&self) -> u64 {
        (FIXED_BYTES + self.cage_bytes() + 4) as u64
    }

    pub(super) fn first_block(&self) -> Vec<u8> {
        let mut block = vec![0; DATA_START as usize];
        block[..HEADER_BYTES].copy_from_slice(&self.header);
        block
    }

    /// Compares the first block with the expected header; the error says what differs.
    pub(super) fn check_first_block(&self, block: &[u8]) -> Result<(), String> {
        let header = &block[..HEADER_BYTES];
        if header == self.header {
            return Ok(());
        }
        if header[80..] != crc32c::crc32c(&header[..80]).to_le_bytes() || header[..8] != MAGIC {
            return Err("its header does not match its checksum".into());
        }
        if u32_at(header, 8) != VERSION {
            return Err(format!("it has version {}, and this program writes version {VERSION}", u32_at(header, 8)));
        }
        if u32_at(header, 12) != self.rows {
            return Err(format!("its cages have {} rows instead of {}", u32_at(header, 12), self.rows));
        }
        Err("it belongs to another session".into())
    }

    /// The larger of the durable lengths in the two marks, and the number of marks written so far modulo 2.
    pub(super) fn marked(&self, block: &[u8]) -> (u64, u64) {
        let claims = MARKS.map(|at| {
            let mark = &block[at as usize..][..MARK_BYTES];
            let intact = mark[8..] == crc32c::crc32c_append(self.seed, &mark[..8]).to_le_bytes();
            if intact { u64_at(mark, 0) } else { 0 }
        });
        // The next mark replaces the smaller length.
        (claims[0].max(claims[1]), u64::from(claims[1] > claims[0]))
    }

    /// Writes a mark with a durable length; `number` is the mark's sequence number.
    pub(super) fn write_mark(&self, file: &dyn DiskFile, number: u64, durable: u64) -> io::Result<()> {
        let mut mark = [0; MARK_BYTES];
        mark[..8].copy_from_slice(&durable.to_le_bytes());
        mark[8..].copy_from_slice(&crc32c::crc32c_append(self.seed, &durable.to_le_bytes()).to_le_bytes());
        file.write_all_at(&mark, MARKS[(number % 2) as usize])
    }

    fn record_crc(&self, offset: u64, record: &[u8]) -> u32 {
        crc32c::crc32c_append(crc32c::crc32c_append(self.seed, &offset.to_le_bytes()), record)
    }

    pub(super) fn write_record(&self, entry: &LogEntry, cage: &[f32], durable: u64, out: &mut Vec<u8>) {
        let start = out.len();
        out.reserve(self.stride() as usize);
        out.extend_from_slice(&entry.frame.to_le_bytes());
        let flags = if entry.full_digest.is_some() { HAS_FULL_DIGEST } else { 0 };
        out.extend_from_slice(&flags.to_le_bytes());
        out.extend_from_slice(&entry.l2.to_le_bytes());
        out.extend_from_slice(&entry.linf.to_le_bytes());
        out.extend_from_slice(&entry.squared.to_le_bytes());
        out.extend_from_slice(&entry.spread.to_le_bytes());
        out.extend_from_slice(&durable.to_le_bytes());
        out.extend_from_slice(&entry.handle_digest);
        out.extend_from_slice(&entry.full_digest.unwrap_or_default());
        out.extend(cage.iter().flat_map(|x| x.to_le_bytes()));
        out.extend_from_slice(&self.record_crc(entry.offset, &out[start..]).to_le_bytes());
    }

    /// Parses the record at `offset`, with the durable length that it recorded; `None` if its checksum does not match.
    pub(super) fn read_record(&self, record: &[u8], offset: u64) -> Option<(LogEntry, u64)> {
        let (body, crc) = record.split_at_checked(self.stride() as usize - 4)?;
        if crc != self.record_crc(offset, body).to_le_bytes() {
            return None;
        }
        let entry = LogEntry {
            frame: u32_at(body, 0),
            offset,
            l2: f32::from_bits(u32_at(body, 8)),
            linf: f32::from_bits(u32_at(body, 12)),
            squared: f64::from_bits(u64_at(body, 16)),
            spread: f64::from_bits(u64_at(body, 24)),
            handle_digest: std::array::from_fn(|i| body[40 + i]),
            full_digest: (u32_at(body, 4) & HAS_FULL_DIGEST != 0).then(|| std::array::from_fn(|i| body[56 + i])),
        };
        Some((entry, u64_at(body, 32)))
    }

    /// The bytes of the cage in a record.
    pub(super) fn cage<'a>(&self, record: &'a [u8]) -> &'a [u8] {
        &record[FIXED_BYTES..][..self.cage_bytes()]
    }
}

fn u32_at(bytes: &[u8], at: usize) -> u32 {
    u32::from_le_bytes(std::array::from_fn(|i| bytes[at + i]))
}

fn u64_at(bytes: &[u8], at: usize) -> u64 {
    u64::from_le_bytes(std::array::from_fn(|i| bytes[at + i]))
}
