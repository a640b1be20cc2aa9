//! Stores chunks and frames by one statement, whose parameters are columns.

use crate::chunks::Chunk;
use crate::engine::{kind_value, phase_value};
use crate::link::{Link, Value};
use crate::trouble::Trouble;
use crate::{CagePlace, CatalogError, FrameEntry, Kind, Phase, checksums};
use std::collections::BTreeMap;
use std::ops::Range;
use std::sync::{Mutex, PoisonError};

/// Numbers of chunks that are drawn together, as the tables say.
const DRAWN: i64 = 1024;

/// For a session that is there and not deleted, which it keeps so until the transaction ends. Says whether there is
/// one.
const APPEND: &str = "\
WITH session AS (
    SELECT number FROM records WHERE kind = $1 AND id = $2 AND phase <> $3 FOR KEY SHARE
), chunked AS (
    INSERT INTO chunks (number, record, counted, bytes)
    SELECT new.number, session.number, new.counted, new.bytes
    FROM session, unnest($4::bigint[], $5::bigint[], $6::bytea[]) AS new (number, counted, bytes)
), framed AS (
    INSERT INTO frames
        (record, frame, chunk, place, bytes, cage_crc, l2, linf, squared, spread, handle_digest, full_digest, crc)
    SELECT session.number, new.*
    FROM session, unnest($7::bigint[], $8::bigint[], $9::bigint[], $10::bigint[], $11::bigint[], $12::float8[],
        $13::float8[], $14::float8[], $15::float8[], $16::bytea[], $17::bytea[], $18::bigint[]) AS new
    ON CONFLICT (record, frame) DO UPDATE SET chunk = excluded.chunk, place = excluded.place, bytes = excluded.bytes,
        cage_crc = excluded.cage_crc, l2 = excluded.l2, linf = excluded.linf, squared = excluded.squared,
        spread = excluded.spread,
        handle_digest = excluded.handle_digest, full_digest = excluded.full_digest, crc = excluded.crc
)
SELECT count(*) FROM session";

/// Numbers of chunks that nobody else has.
#[derive(Default)]
pub(super) struct Numbers(Mutex<Range<i64>>);

impl Numbers {
    /// Stores frames of `session`. Gives them as they are stored.
    pub(super) fn append(&self, link: &mut Link, session: &str, chunks: &[Chunk]) -> Result<Vec<FrameEntry>, Trouble> {
        let numbers = self.draw(link, chunks.len())?;
        let placed = chunks.iter().zip(&numbers).flat_map(|(of, chunk)| {
            of.entries.iter().map(|entry| FrameEntry { place: CagePlace { chunk: *chunk, ..entry.place }, ..*entry })
        });
        let stored: Vec<FrameEntry> = placed.collect();
        // Ascending, so that no two calls wait for each other, and each frame once, with what was last said of it.
        let last: BTreeMap<u32, &FrameEntry> = stored.iter().map(|entry| (entry.frame, entry)).collect();
        let integers = |of: &dyn Fn(&FrameEntry) -> i64| -> Vec<i64> { last.values().map(|entry| of(entry)).collect() };
        let reals = |of: &dyn Fn(&FrameEntry) -> f64| -> Vec<f64> { last.values().map(|entry| of(entry)).collect() };
        let counted: Vec<i64> = chunks.iter().map(Chunk::counted).collect();
        let bytes: Vec<_> = chunks.iter().map(|chunk| Some(&chunk.bytes[..])).collect();
        let handle_digests: Vec<_> = last.values().map(|entry| Some(&entry.handle_digest[..])).collect();
        let full_digests: Vec<_> = last.values().map(|entry| entry.full_digest.as_ref().map(|of| &of[..])).collect();
        let values = [
            kind_value(Kind::Session),
            Value::Text(session),
            phase_value(Phase::Deleted),
            Value::Integers(&numbers),
            Value::Integers(&counted),
            Value::Blobs(&bytes),
            Value::Integers(&integers(&|entry| entry.frame.into())),
            Value::Integers(&integers(&|entry| entry.place.chunk)),
            Value::Integers(&integers(&|entry| entry.place.offset.into())),
            Value::Integers(&integers(&|entry| entry.place.bytes.into())),
            Value::Integers(&integers(&|entry| entry.place.crc.into())),
            Value::Reals(&reals(&|entry| entry.l2.into())),
            Value::Reals(&reals(&|entry| entry.linf.into())),
            Value::Reals(&reals(&|entry| entry.squared)),
            Value::Reals(&reals(&|entry| entry.spread)),
            Value::Blobs(&handle_digests),
            Value::Blobs(&full_digests),
            Value::Integers(&integers(&|entry| checksums::of_entry(session, entry).into())),
        ];
        let found: Result<i64, Trouble> = link.only(APPEND, &values).inspect_err(|_| {
            // A database that was restored may give numbers again.
            *self.0.lock().unwrap_or_else(PoisonError::into_inner) = 0..0;
        });
        if found? == 1 { Ok(stored) } else { Err(CatalogError::Gone.into()) }
    }

    /// So many numbers for chunks.
    fn draw(&self, link: &mut Link, count: usize) -> Result<Vec<i64>, Trouble> {
        let mut drawn = Vec::with_capacity(count);
        loop {
            {
                let mut numbers = self.0.lock().unwrap_or_else(PoisonError::into_inner);
                drawn.extend(numbers.by_ref().take(count - drawn.len()));
            }
            if drawn.len() == count {
                return Ok(drawn);
            }
            let first: i64 = link.only("SELECT nextval('chunk_numbers')", &[])?;
            *self.0.lock().unwrap_or_else(PoisonError::into_inner) = first..first + DRAWN;
        }
    }
}
