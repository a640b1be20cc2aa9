//! Rows of the tables and what they say.

use crate::{CagePlace, CatalogError, Change, FrameEntry, Kind, Record, checksums, numbers};
use rusqlite::types::Type;
use rusqlite::{Connection, Row, ToSql, params};

pub(super) const RECORD: &str = "SELECT kind, id, created_ms, phase, meta, outcome, completion, announcement, damage, attempts, declared, reached, frame_bytes FROM records";

/// The kind and the id of a row of [`RECORD`] that cannot be read otherwise, as far as they can.
pub(super) fn identity(row: &Row<'_>) -> String {
    let kind = row.get(0).ok().and_then(numbers::kind);
    format!("{} {}", kind.map_or("record", Kind::name), row.get::<_, String>(1).unwrap_or_default())
}

pub(super) fn record(row: &Row<'_>) -> rusqlite::Result<Record> {
    let unknown = |column, what: &str| {
        rusqlite::Error::FromSqlConversionFailure(column, Type::Integer, format!("an unknown {what}").into())
    };
    Ok(Record {
        kind: numbers::kind(row.get(0)?).ok_or_else(|| unknown(0, "kind"))?,
        id: row.get(1)?,
        created_ms: row.get::<_, i64>(2)? as u64,
        phase: numbers::phase(row.get(3)?).ok_or_else(|| unknown(3, "phase"))?,
        meta: row.get(4)?,
        outcome: row.get(5)?,
        completion: row.get(6)?,
        announcement: row.get(7)?,
        damage: row.get(8)?,
        attempts: row.get(9)?,
        declared: row.get(10)?,
        reached: row.get(11)?,
        frame_bytes: row.get::<_, i64>(12)? as u64,
    })
}

/// Makes a change of the record with this number.
pub(super) fn change(connection: &Connection, number: i64, change: &Change) -> Result<(), CatalogError> {
    let phase;
    let value: &dyn ToSql = match change {
        Change::Phase(to) => {
            phase = numbers::phase_number(*to);
            &phase
        }
        Change::Meta(bytes) | Change::Outcome(bytes) | Change::Completion(bytes) | Change::Announcement(bytes) => bytes,
        Change::Damage(what) => what,
        Change::Attempts(count) | Change::Declared(count) | Change::Reached(count) => count,
    };
    let column = numbers::column(change);
    let mut statement = connection.prepare_cached(&format!("UPDATE records SET {column} = ?2 WHERE number = ?1"))?;
    statement.execute(params![number, value])?;
    Ok(())
}

pub(super) const FRAME: &str = "SELECT frame, chunk, place, bytes, cage_crc, l2, linf, squared, spread, handle_digest, full_digest, crc FROM frames WHERE record = ?1 ORDER BY frame";

/// A frame of `session`.
pub(super) fn frame(session: &str, row: &Row<'_>) -> Result<FrameEntry, CatalogError> {
    let number = |column| row.get::<_, Option<f64>>(column).map(|number| number.unwrap_or(f64::NAN));
    let place = CagePlace { chunk: row.get(1)?, offset: row.get(2)?, bytes: row.get(3)?, crc: row.get(4)? };
    let entry = FrameEntry {
        frame: row.get(0)?,
        place,
        l2: number(5)? as f32,
        linf: number(6)? as f32,
        squared: number(7)?,
        spread: number(8)?,
        handle_digest: row.get(9)?,
        full_digest: row.get(10)?,
    };
    match row.get::<_, u32>(11)? == checksums::of_entry(session, &entry) {
        true => Ok(entry),
        false => Err(checksums::mismatch(entry.frame)),
    }
}

/// Stores a frame of `session`, whose record has this number.
pub(super) fn put_frame(
    connection: &Connection,
    number: i64,
    session: &str,
    entry: &FrameEntry,
) -> Result<(), CatalogError> {
    let mut statement = connection.prepare_cached(
        "INSERT OR REPLACE INTO frames VALUES (?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8, ?9, ?10, ?11, ?12, ?13)",
    )?;
    let FrameEntry { frame, place, l2, linf, squared, spread, handle_digest, full_digest } = entry;
    let CagePlace { chunk, offset, bytes, crc } = place;
    let (l2, linf, sum) = (f64::from(*l2), f64::from(*linf), checksums::of_entry(session, entry));
    statement.execute(params![
        number,
        frame,
        chunk,
        offset,
        bytes,
        crc,
        l2,
        linf,
        squared,
        spread,
        handle_digest,
        full_digest,
        sum
    ])?;
    Ok(())
}
