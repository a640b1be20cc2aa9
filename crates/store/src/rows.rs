//! Rows of records and frames, and what they say.

use crate::link::{Link, Row, Value};
use crate::trouble::Trouble;
use crate::{CagePlace, Change, FrameEntry, Kind, Record, checksums, numbers};
use sqlx::AssertSqlSafe;
use std::collections::BTreeMap;

const RECORD: &str = "\
    SELECT CAST(kind AS bigint), id, created_ms, CAST(phase AS bigint), meta, outcome, completion, announcement, damage, \
    attempts, declared, reached";

/// Selects the record of a kind and an id.
pub(crate) fn one(link: &Link) -> AssertSqlSafe<String> {
    // PostgreSQL counts what frames take in the chunks: in the record it would have appends wait for each other.
    let frame_bytes = match link.is_postgres() {
        true => "CAST(coalesce((SELECT sum(counted) FROM chunks WHERE record = records.number), 0) AS bigint)",
        false => "frame_bytes",
    };
    AssertSqlSafe(format!("{RECORD}, {frame_bytes} FROM records WHERE kind = $1 AND id = $2"))
}

/// As [`one`], all of them, oldest first.
pub(crate) fn all(link: &Link) -> AssertSqlSafe<String> {
    let (frame_bytes, join) = match link.is_postgres() {
        // Not for each record: without statistics that takes a hundred times as long.
        true => (
            "CAST(coalesce(counted, 0) AS bigint)",
            " LEFT JOIN (SELECT record, sum(counted) AS counted FROM chunks GROUP BY record) AS sums \
             ON record = number",
        ),
        false => ("frame_bytes", ""),
    };
    AssertSqlSafe(format!("{RECORD}, {frame_bytes} FROM records{join} ORDER BY created_ms, id"))
}

/// The kind and the id of a record that cannot be read otherwise, as far as they can.
pub(crate) fn identity(row: &Row) -> String {
    let kind = row.number(0).ok().and_then(numbers::kind);
    format!("{} {}", kind.map_or("record", Kind::name), row.get::<&str>(1).unwrap_or_default())
}

pub(crate) fn record(row: &Row) -> Result<Record, Trouble> {
    Ok(Record {
        kind: numbers::kind(row.number(0)?).ok_or_else(|| row.unreadable(0))?,
        id: row.get(1)?,
        created_ms: row.get::<i64>(2)? as u64,
        phase: numbers::phase(row.number(3)?).ok_or_else(|| row.unreadable(3))?,
        meta: row.get(4)?,
        outcome: row.get(5)?,
        completion: row.get(6)?,
        announcement: row.get(7)?,
        damage: row.get(8)?,
        attempts: row.number(9)?,
        declared: row.optional(10)?,
        reached: row.number(11)?,
        frame_bytes: row.number(12)?,
    })
}

/// What changes set, by column: the last one of a column counts.
pub(crate) fn columns(changes: &[Change]) -> BTreeMap<&'static str, Value<'_>> {
    changes.iter().map(|change| (numbers::column(change), value(change))).collect()
}

fn value(change: &Change) -> Value<'_> {
    match change {
        Change::Phase(to) => Value::Integer(numbers::phase_number(*to).into()),
        Change::Meta(bytes) | Change::Outcome(bytes) | Change::Completion(bytes) | Change::Announcement(bytes) => {
            Value::Bytes(Some(bytes))
        }
        Change::Damage(what) => Value::Text(what),
        Change::Attempts(count) | Change::Declared(count) | Change::Reached(count) => Value::Integer((*count).into()),
    }
}

/// The frames of a record.
pub(crate) const FRAMES: &str = "\
    SELECT frame, chunk, place, bytes, cage_crc, CAST(l2 AS double precision), CAST(linf AS double precision), squared, \
    spread, handle_digest, full_digest, crc FROM frames WHERE record = $1 ORDER BY frame";

/// A frame of `session`.
pub(crate) fn frame(session: &str, row: &Row) -> Result<FrameEntry, Trouble> {
    // SQLite keeps what is not a number as NULL.
    let real = |column| row.get::<Option<f64>>(column).map(|number| number.unwrap_or(f64::NAN));
    let place = CagePlace { chunk: row.get(1)?, offset: row.number(2)?, bytes: row.number(3)?, crc: row.number(4)? };
    let digest = |bytes: &[u8], column| <[u8; 16]>::try_from(bytes).map_err(|_| row.unreadable(column));
    let entry = FrameEntry {
        frame: row.number(0)?,
        place,
        l2: real(5)? as f32,
        linf: real(6)? as f32,
        squared: real(7)?,
        spread: real(8)?,
        handle_digest: digest(row.get(9)?, 9)?,
        full_digest: row.get::<Option<&[u8]>>(10)?.map(|bytes| digest(bytes, 10)).transpose()?,
    };
    match row.number::<u32>(11)? == checksums::of_entry(session, &entry) {
        true => Ok(entry),
        false => Err(checksums::mismatch(entry.frame).into()),
    }
}
