//! Rows of the tables and what they say.

use crate::{CagePlace, CatalogError, Change, FrameEntry, Kind, Phase, Record, checksums};
use rusqlite::types::Type;
use rusqlite::{Connection, Row, ToSql, params};

pub(super) const RECORD: &str = "SELECT kind, id, created_ms, phase, meta, outcome, completion, announcement, damage, attempts, declared, reached, frame_bytes FROM records";

pub(super) fn kind_number(kind: Kind) -> u8 {
    match kind {
        Kind::Session => 0,
        Kind::CageJob => 1,
        Kind::Recovery => 2,
        Kind::Transfer => 3,
    }
}

/// Several bits apart: rows have no checksum, and what is deleted is removed by the next start.
pub(super) fn phase_number(phase: Phase) -> u8 {
    match phase {
        Phase::Creating => 0x11,
        Phase::Importing => 0x22,
        Phase::Open => 0x44,
        Phase::Deleted => 0x78,
    }
}

/// The kind and the id of a row of [`RECORD`] that cannot be read otherwise, as far as they can.
pub(super) fn identity(row: &Row<'_>) -> String {
    let kind: Option<u8> = row.get(0).ok();
    let kind = Kind::ALL.into_iter().find(|of| Some(kind_number(*of)) == kind).map_or("record", Kind::name);
    format!("{kind} {}", row.get::<_, String>(1).unwrap_or_default())
}

pub(super) fn record(row: &Row<'_>) -> rusqlite::Result<Record> {
    let unknown = |column, what: &str| {
        rusqlite::Error::FromSqlConversionFailure(column, Type::Integer, format!("an unknown {what}").into())
    };
    let (kind, phase): (u8, u8) = (row.get(0)?, row.get(3)?);
    let kind = Kind::ALL.into_iter().find(|of| kind_number(*of) == kind).ok_or_else(|| unknown(0, "kind"))?;
    let phases = [Phase::Creating, Phase::Importing, Phase::Open, Phase::Deleted];
    let phase = phases.into_iter().find(|of| phase_number(*of) == phase).ok_or_else(|| unknown(3, "phase"))?;
    Ok(Record {
        kind,
        id: row.get(1)?,
        created_ms: row.get::<_, i64>(2)? as u64,
        phase,
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
    let (column, value): (&str, &dyn ToSql) = match change {
        Change::Phase(to) => {
            phase = phase_number(*to);
            ("phase", &phase)
        }
        Change::Outcome(bytes) => ("outcome", bytes),
        Change::Completion(bytes) => ("completion", bytes),
        Change::Announcement(bytes) => ("announcement", bytes),
        Change::Damage(what) => ("damage", what),
        Change::Attempts(count) => ("attempts", count),
        Change::Declared(frames) => ("declared", frames),
        Change::Reached(frames) => ("reached", frames),
    };
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
        false => Err(CatalogError::Damaged(format!("frame {} does not match its checksum", entry.frame))),
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
