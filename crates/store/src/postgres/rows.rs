//! Rows of the tables and what they say.

use super::trouble::Trouble;
use crate::{CagePlace, CatalogError, Change, FrameEntry, Kind, Record, checksums, numbers};
use std::collections::BTreeMap;
use tokio_postgres::Row;
use tokio_postgres::types::{FromSqlOwned, ToSql};

pub(super) const RECORD: &str = "SELECT kind, id, created_ms, phase, meta, outcome, completion, announcement, damage, attempts, declared, reached, coalesce((SELECT sum(counted) FROM chunks WHERE record = records.number), 0)::bigint FROM records WHERE kind = $1 AND id = $2";

/// As [`RECORD`], of all of them.
pub(super) const RECORDS: &str = "SELECT kind, id, created_ms, phase, meta, outcome, completion, announcement, damage, attempts, declared, reached, coalesce(counted, 0)::bigint FROM records LEFT JOIN (SELECT record, sum(counted) AS counted FROM chunks GROUP BY record) AS sums ON record = number ORDER BY created_ms, id";

pub(super) fn kind_number(kind: Kind) -> i16 {
    numbers::kind_number(kind).into()
}

/// A column whose numbers are those of `T`.
fn number<T: TryFrom<i64>>(row: &Row, column: usize) -> Result<T, Trouble> {
    optional(row, column)?.ok_or_else(|| unreadable(row, column).into())
}

fn optional<T: TryFrom<i64>>(row: &Row, column: usize) -> Result<Option<T>, Trouble> {
    let number: Option<i64> = row.try_get(column)?;
    number.map(|number| T::try_from(number).map_err(|_| unreadable(row, column).into())).transpose()
}

fn unreadable(row: &Row, column: usize) -> CatalogError {
    CatalogError::Damaged(format!("the column {} has a value that was never written", row.columns()[column].name()))
}

/// The kind and the id of a record that cannot be read otherwise, as far as they can.
pub(super) fn identity(row: &Row) -> String {
    let kind = row.try_get::<_, i16>(0).ok().and_then(|number| u8::try_from(number).ok()).and_then(numbers::kind);
    format!("{} {}", kind.map_or("record", Kind::name), row.try_get::<_, &str>(1).unwrap_or_default())
}

pub(super) fn record(row: &Row) -> Result<Record, Trouble> {
    let small = |column| -> Result<u8, Trouble> {
        u8::try_from(row.try_get::<_, i16>(column)?).map_err(|_| unreadable(row, column).into())
    };
    Ok(Record {
        kind: numbers::kind(small(0)?).ok_or_else(|| unreadable(row, 0))?,
        id: row.try_get(1)?,
        created_ms: row.try_get::<_, i64>(2)? as u64,
        phase: numbers::phase(small(3)?).ok_or_else(|| unreadable(row, 3))?,
        meta: row.try_get(4)?,
        outcome: row.try_get(5)?,
        completion: row.try_get(6)?,
        announcement: row.try_get(7)?,
        damage: row.try_get(8)?,
        attempts: number(row, 9)?,
        declared: optional(row, 10)?,
        reached: number(row, 11)?,
        frame_bytes: number(row, 12)?,
    })
}

/// What changes set, by column: the last one of a column counts.
pub(super) fn columns(changes: &[Change]) -> BTreeMap<&'static str, Box<dyn ToSql + Sync + '_>> {
    changes.iter().map(|change| (numbers::column(change), value(change))).collect()
}

fn value(change: &Change) -> Box<dyn ToSql + Sync + '_> {
    match change {
        Change::Phase(to) => Box::new(i16::from(numbers::phase_number(*to))),
        Change::Meta(bytes) | Change::Outcome(bytes) | Change::Completion(bytes) | Change::Announcement(bytes) => {
            Box::new(&bytes[..])
        }
        Change::Damage(what) => Box::new(&what[..]),
        Change::Attempts(count) | Change::Declared(count) | Change::Reached(count) => Box::new(i64::from(*count)),
    }
}

pub(super) const FRAMES: &str = "SELECT frame, chunk, place, bytes, cage_crc, l2, linf, squared, spread, handle_digest, full_digest, crc FROM frames WHERE record = $1 ORDER BY frame";

/// A frame of `session`.
pub(super) fn frame(session: &str, row: &Row) -> Result<FrameEntry, Trouble> {
    let place =
        CagePlace { chunk: row.try_get(1)?, offset: number(row, 2)?, bytes: number(row, 3)?, crc: number(row, 4)? };
    let digest = |bytes: &[u8], column| <[u8; 16]>::try_from(bytes).map_err(|_| unreadable(row, column));
    let entry = FrameEntry {
        frame: number(row, 0)?,
        place,
        l2: row.try_get(5)?,
        linf: row.try_get(6)?,
        squared: row.try_get(7)?,
        spread: row.try_get(8)?,
        handle_digest: digest(row.try_get(9)?, 9)?,
        full_digest: row.try_get::<_, Option<&[u8]>>(10)?.map(|bytes| digest(bytes, 10)).transpose()?,
    };
    match number::<u32>(row, 11)? == checksums::of_entry(session, &entry) {
        true => Ok(entry),
        false => Err(checksums::mismatch(entry.frame).into()),
    }
}

/// Stores chunks and frames of a session that is there and not deleted, which it keeps so until the transaction ends. Says whether there is one.
pub(super) const APPEND: &str = "\
WITH session AS (
    SELECT number FROM records WHERE kind = $1 AND id = $2 AND phase <> $3 FOR KEY SHARE
), chunked AS (
    INSERT INTO chunks (number, record, counted, bytes)
    SELECT new.number, session.number, new.counted, new.bytes
    FROM session, unnest($4::bigint[], $5::bigint[], $6::bytea[]) AS new (number, counted, bytes)
), framed AS (
    INSERT INTO frames (record, frame, chunk, place, bytes, cage_crc, l2, linf, squared, spread, handle_digest, full_digest, crc)
    SELECT session.number, new.*
    FROM session, unnest($7::bigint[], $8::bigint[], $9::bigint[], $10::bigint[], $11::bigint[], $12::real[], $13::real[],
        $14::float8[], $15::float8[], $16::bytea[], $17::bytea[], $18::bigint[]) AS new
    ON CONFLICT (record, frame) DO UPDATE SET chunk = excluded.chunk, place = excluded.place, bytes = excluded.bytes,
        cage_crc = excluded.cage_crc, l2 = excluded.l2, linf = excluded.linf, squared = excluded.squared, spread = excluded.spread,
        handle_digest = excluded.handle_digest, full_digest = excluded.full_digest, crc = excluded.crc
)
SELECT count(*) FROM session";

/// The columns of frames for [`APPEND`].
pub(super) struct Columns {
    numbers: [Vec<i64>; 6],
    singles: [Vec<f32>; 2],
    doubles: [Vec<f64>; 2],
    handle_digests: Vec<Vec<u8>>,
    full_digests: Vec<Option<Vec<u8>>>,
}

impl Columns {
    /// Of frames of `session`: ascending, so that no two calls wait for each other, and each number once, with what was last said of it.
    pub(super) fn new(session: &str, entries: &[FrameEntry]) -> Self {
        let last: BTreeMap<u32, &FrameEntry> = entries.iter().map(|entry| (entry.frame, entry)).collect();
        let integer = |of: fn(&FrameEntry) -> i64| last.values().map(|entry| of(entry)).collect();
        let single = |of: fn(&FrameEntry) -> f32| last.values().map(|entry| of(entry)).collect();
        let double = |of: fn(&FrameEntry) -> f64| last.values().map(|entry| of(entry)).collect();
        Self {
            numbers: [
                integer(|entry| entry.frame.into()),
                integer(|entry| entry.place.chunk),
                integer(|entry| entry.place.offset.into()),
                integer(|entry| entry.place.bytes.into()),
                integer(|entry| entry.place.crc.into()),
                last.values().map(|entry| checksums::of_entry(session, entry).into()).collect(),
            ],
            singles: [single(|entry| entry.l2), single(|entry| entry.linf)],
            doubles: [double(|entry| entry.squared), double(|entry| entry.spread)],
            handle_digests: last.values().map(|entry| entry.handle_digest.to_vec()).collect(),
            full_digests: last.values().map(|entry| entry.full_digest.map(|digest| digest.to_vec())).collect(),
        }
    }

    pub(super) fn parameters(&self) -> Vec<&(dyn ToSql + Sync)> {
        let [frame, chunk, place, bytes, cage_crc, crc] = &self.numbers;
        let ([l2, linf], [squared, spread]) = (&self.singles, &self.doubles);
        vec![
            frame,
            chunk,
            place,
            bytes,
            cage_crc,
            l2,
            linf,
            squared,
            spread,
            &self.handle_digests,
            &self.full_digests,
            crc,
        ]
    }
}

/// The first column of the first row, as statements have it that always answer.
pub(super) fn only<T: FromSqlOwned>(rows: &[Row]) -> Result<T, Trouble> {
    let row = rows.first().ok_or_else(|| CatalogError::Failed("the database gave no row".to_owned()))?;
    Ok(row.try_get(0)?)
}
