//! Taking over what versions before the catalogue stored: a file for each thing that is known of a session or job, and a log of frames. Each object is
//! taken over as a whole; what was its own file is removed afterwards, its metadata last.

mod log;

use super::files::Files;
use super::records::{Left, all, meta_of};
use super::{CageJobMeta, Kind, Quarantined, RecordMeta, RecoveryMeta, SessionMeta, Store, StoreError, TransferMeta};
use super::{is_session_id, meta};
use cager_store::{Change, FrameEntry, Key, NewFrame, NewRecord, Phase, Record};
use log::Log;
use serde::de::DeserializeOwned;
use std::collections::{HashMap, HashSet};
use std::path::Path;
use std::sync::atomic::Ordering::Relaxed;

/// Longest of their small files, in bytes.
const LIMIT: u64 = 1 << 20;
const LOG: &str = "frames.log";
/// Frames that are taken over at a time.
const FRAMES: usize = 64;

/// Name of the file with the metadata, by which a folder of theirs is known.
fn meta_file(kind: Kind) -> &'static str {
    match kind {
        Kind::Session => "session.json",
        Kind::CageJob => "job.json",
        Kind::Recovery => "recovery.json",
        Kind::Transfer => "transfer.json",
    }
}

/// Their other files, which are part of the record now.
const SMALL: [&str; 5] = ["outcome.json", "complete.json", "announce.json", "attempts.json", "reached.json"];

/// Whether there are objects that only a catalogue can tell of.
pub(super) fn is_without_records(files: &Files) -> Result<bool, StoreError> {
    for kind in Kind::ALL {
        for entry in files.list(all(kind, files))? {
            let folder = all(kind, files).join(&entry.name);
            // Empty ones too: those of sessions that run are.
            if entry.is_dir && !files.exists(&folder.join(meta_file(kind)))? {
                return Ok(true);
            }
        }
    }
    Ok(false)
}

impl Store {
    /// Takes over all objects of earlier versions, and finishes what an earlier start did not live to. Gives all records, and what could not be read:
    /// that stays, and is tried again by the next start. What is damaged is moved to quarantine.
    pub(super) fn take_over(
        &self,
        records: Vec<Record>,
        quarantined: &mut Vec<Quarantined>,
    ) -> Result<(Vec<Record>, Left), StoreError> {
        let (files, mut left) = (self.files(), HashSet::new());
        let phases: HashMap<(Kind, &str), Phase> = records.iter().map(|r| ((r.kind, &r.id[..]), r.phase)).collect();
        let mut changed = false;
        for kind in Kind::ALL {
            for entry in files.list(all(kind, files))? {
                let (id, folder) = (entry.name.to_string_lossy(), all(kind, files).join(&entry.name));
                let phase = phases.get(&(kind, &id)).copied();
                let key = Key { kind, id: &id };
                match self.take_over_if_old(key, phase, entry.is_dir, &folder) {
                    Ok(taken) => changed |= taken,
                    Err(error @ StoreError::Damaged { .. }) => {
                        changed = true;
                        quarantined.push(files.move_to_quarantine(&folder, &error.to_string())?);
                        self.catalog().remove(key).map_err(|e| self.failed("write", e))?;
                    }
                    // A disk without room for it would lose nothing, and serve nothing of it either.
                    Err(error @ StoreError::Full { .. }) => return Err(error),
                    Err(error) => {
                        tracing::error!(%error, kind = kind.name(), %id, "cannot be taken over, and is left where it is");
                        self.inner.keeps_contents.store(true, Relaxed);
                        left.insert((kind, id.into_owned()));
                    }
                }
            }
        }
        drop(phases);
        let records = if changed { self.catalog().records().map_err(|e| self.failed("read", e))? } else { records };
        Ok((records, left))
    }

    /// Whether it was one of an earlier version, which is taken over now.
    fn take_over_if_old(
        &self,
        key: Key<'_>,
        phase: Option<Phase>,
        is_dir: bool,
        folder: &Path,
    ) -> Result<bool, StoreError> {
        if !is_dir || !is_session_id(key.id) || !self.files().exists(&folder.join(meta_file(key.kind)))? {
            return Ok(false);
        }
        match phase {
            Some(Phase::Creating | Phase::Deleted) => return Ok(false),
            Some(Phase::Open) => {}
            Some(Phase::Importing) | None => self.take_over_one(key, folder)?,
        }
        self.forget_old_files(key, folder).map(|()| true)
    }

    /// Makes the record of an object, and stores its frames.
    fn take_over_one(&self, key: Key<'_>, folder: &Path) -> Result<(), StoreError> {
        let failed = |e| self.failed("write", e);
        // What an earlier start began.
        self.catalog().remove(key).map_err(failed)?;
        let read = |name: &str| self.files().read(&folder.join(name), LIMIT);
        let damaged = |what: String| StoreError::damaged(&folder.join(meta_file(key.kind)), what);
        let bytes = read(meta_file(key.kind))?.ok_or_else(|| damaged("it is missing".to_owned()))?;
        let created_ms = created_ms(key, &bytes).map_err(damaged)?;
        let record = NewRecord { key, created_ms, phase: Phase::Importing, meta: &bytes };
        self.catalog().create(record).map_err(failed)?;
        let mut changes = Vec::new();
        let outcome = read("outcome.json")?;
        let is_ready = outcome.as_ref().and_then(|bytes| parsed::<serde_json::Value>(bytes, "outcome"));
        let is_ready = key.kind == Kind::Session && is_ready.is_some_and(|outcome| outcome.get("ready").is_some());
        changes.extend(outcome.map(Change::Outcome));
        changes.extend(read("announce.json")?.map(Change::Announcement));
        let number = |bytes: Vec<u8>, what: &str| -> Option<u32> { parsed(&bytes, what) };
        changes.extend(read("attempts.json")?.and_then(|bytes| number(bytes, "attempts")).map(Change::Attempts));
        changes.extend(read("reached.json")?.and_then(|bytes| number(bytes, "progress")).map(Change::Reached));
        if let Some(bytes) = read("complete.json")? {
            changes.extend(match key.kind {
                // A damaged one is found where it is needed.
                Kind::Session => Some(Change::Completion(bytes)),
                _ => number(bytes, "completion").map(Change::Declared),
            });
        }
        let log = Log::open(self.files(), &folder.join(LOG), key.id);
        match log.and_then(|log| log.as_ref().map(|log| self.take_over_frames(key.id, log)).transpose()) {
            Err(StoreError::Damaged { what, .. }) => changes.push(Change::Damage(what)),
            Ok(None) if is_ready => changes.push(Change::Damage("the frame log is gone".to_owned())),
            taken => drop(taken?),
        }
        changes.push(Change::Phase(Phase::Open));
        self.change(key, &changes)
    }

    fn take_over_frames(&self, id: &str, log: &Log) -> Result<(), StoreError> {
        let mut known: HashSet<(u32, bool)> = HashSet::new();
        log.read(FRAMES, |frames| {
            // Of a frame that is there twice, the first counts, unless only the other was measured.
            let mut is_new = |entry: &FrameEntry| {
                !known.contains(&(entry.frame, true)) && known.insert((entry.frame, entry.full_digest.is_some()))
            };
            let new: Vec<NewFrame<'_>> = frames.iter().copied().filter(|frame| is_new(&frame.entry)).collect();
            self.append_frames(id, &new).map(|_| ())
        })
    }

    /// Removes the files of an object whose record has all that they said.
    fn forget_old_files(&self, key: Key<'_>, folder: &Path) -> Result<(), StoreError> {
        let files = self.files();
        let is_damaged = self.damage(key.kind, key.id)?.is_some();
        SMALL.iter().try_for_each(|name| files.remove_file(&folder.join(name)))?;
        if !is_damaged {
            // Of a damaged one a person may want to save what can be.
            files.remove_file(&folder.join(LOG))?;
        }
        files.remove_file(&folder.join(meta_file(key.kind)))?;
        files.sync_dir(folder)
    }
}

/// When an object with this metadata was created; what is wrong with it where it is damaged.
fn created_ms(key: Key<'_>, bytes: &[u8]) -> Result<u64, String> {
    fn of<M: RecordMeta>(key: Key<'_>, bytes: &[u8]) -> Result<u64, String> {
        let record = Record {
            kind: key.kind,
            id: key.id.to_owned(),
            created_ms: 0,
            phase: Phase::Importing,
            meta: bytes.to_vec(),
            outcome: None,
            completion: None,
            announcement: None,
            damage: None,
            attempts: 0,
            declared: None,
            reached: 0,
            frame_bytes: 0,
        };
        meta_of::<M>(&record).map(|meta| meta.created_ms())
    }
    match key.kind {
        Kind::Session => of::<SessionMeta>(key, bytes),
        Kind::CageJob => of::<CageJobMeta>(key, bytes),
        Kind::Recovery => of::<RecoveryMeta>(key, bytes),
        Kind::Transfer => of::<TransferMeta>(key, bytes),
    }
}

/// What a small file says, unless it is damaged.
fn parsed<T: DeserializeOwned>(bytes: &[u8], what: &str) -> Option<T> {
    meta::unwrap(bytes, what).ok()
}
