//! From one catalogue to another.

use crate::{Catalog, CatalogError, Change, FrameEntry, Key, Kind, NewFrame, NewRecord, Phase, Record};

/// Frames that are copied at a time.
const FRAMES: usize = 64;

/// Copies all records with their frames, but for those that are there; what an earlier call did not live to finish is begun anew. Gives how many records
/// it copied.
///
/// A session whose frames are damaged is copied as one that is damaged, without the damaged ones and those that are read with them.
///
/// # Errors
/// Those of either catalogue.
pub fn copy(from: &dyn Catalog, to: &dyn Catalog) -> Result<usize, CatalogError> {
    let mut copied = 0;
    for record in from.records()? {
        let key = Key { kind: record.kind, id: &record.id };
        match to.record(key)? {
            Some(there) if there.phase != Phase::Creating => continue,
            Some(_) => to.remove(key)?,
            None => {}
        }
        let new = NewRecord { key, created_ms: record.created_ms, phase: Phase::Creating, meta: &record.meta };
        to.create(new)?;
        let damage = match record.kind {
            Kind::Session => copy_frames(from, to, &record.id)?,
            _ => None,
        };
        to.change(key, &changes(&record, damage))?;
        copied += 1;
    }
    Ok(copied)
}

/// What is said of a record beside its metadata.
fn changes(record: &Record, damage: Option<String>) -> Vec<Change> {
    let mut changes = vec![Change::Attempts(record.attempts), Change::Reached(record.reached)];
    changes.extend(record.outcome.clone().map(Change::Outcome));
    changes.extend(record.completion.clone().map(Change::Completion));
    changes.extend(record.announcement.clone().map(Change::Announcement));
    changes.extend(record.damage.clone().or(damage).map(Change::Damage));
    changes.extend(record.declared.map(Change::Declared));
    changes.push(Change::Phase(record.phase));
    changes
}

/// Copies the frames of a session. What is damaged of them.
fn copy_frames(from: &dyn Catalog, to: &dyn Catalog, id: &str) -> Result<Option<String>, CatalogError> {
    let entries = match from.frames(id) {
        Err(CatalogError::Damaged(what)) => return Ok(Some(what)),
        entries => entries?,
    };
    let (mut damage, mut bytes) = (None, Vec::new());
    for some in entries.chunks(FRAMES) {
        bytes.clear();
        match from.cages(id, some, &mut bytes) {
            Err(CatalogError::Damaged(what)) => {
                damage = Some(what);
                continue;
            }
            read => read?,
        }
        let numbers: Vec<f32> = bytes.chunks_exact(4).map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect();
        let mut rest = &numbers[..];
        let frame = |entry: &FrameEntry| {
            let (cage, later) = rest.split_at(entry.cage_bytes() as usize / 4);
            rest = later;
            NewFrame { entry: *entry, cage }
        };
        let frames: Vec<NewFrame<'_>> = some.iter().map(frame).collect();
        to.append(id, &frames)?;
    }
    Ok(damage)
}
