//! What sessions and jobs have in common: a record in the catalogue, and a folder for their files.

use super::files::Files;
use super::names::check_id;
use super::{Kind, Quarantined, Store, StoreError, is_session_id, make_folder, meta};
use crate::sync::lock;
use cager_store::{CatalogError, Change, Key, NewRecord, Phase, Record};
use serde::Serialize;
use serde::de::DeserializeOwned;
use std::collections::HashSet;
use std::path::{Path, PathBuf};
use std::sync::atomic::Ordering::Relaxed;

/// What a message that is due is called where it is stored.
const ANNOUNCEMENT: &str = "announce";

/// What a session or job is; fixed at its creation.
pub(crate) trait RecordMeta: Serialize + DeserializeOwned {
    const KIND: Kind;

    /// Id; also the name of its folder.
    fn id(&self) -> &str;
    /// Creation time, milliseconds since 1970.
    fn created_ms(&self) -> u64;
}

/// The folder that contains all objects of a kind.
pub(super) fn all(kind: Kind, files: &Files) -> &Path {
    match kind {
        Kind::Session => &files.sessions,
        Kind::CageJob => &files.cages,
        Kind::Recovery => &files.recoveries,
        Kind::Transfer => &files.transfers,
    }
}

/// Whether there are objects that only a catalogue can tell of.
pub(super) fn has_objects(files: &Files) -> Result<bool, StoreError> {
    for kind in Kind::ALL {
        // Empty folders too: those of sessions that run are.
        if files.list(all(kind, files))?.iter().any(|entry| entry.is_dir) {
            return Ok(true);
        }
    }
    Ok(false)
}

/// What the outcome of an object is called where it is stored.
pub(super) fn outcome_of(kind: Kind) -> &'static str {
    match kind {
        Kind::CageJob => "cage outcome",
        Kind::Recovery => "recovery outcome",
        Kind::Transfer => "transfer outcome",
        Kind::Session => "outcome",
    }
}

/// The meta of a record; what is wrong with it where it is damaged.
pub(super) fn meta_of<M: RecordMeta>(record: &Record) -> Result<M, String> {
    let meta: M = meta::unwrap(&record.meta, M::KIND.name())?;
    match meta.id() == record.id && is_session_id(&record.id) {
        true => Ok(meta),
        false => Err(format!("its metadata belongs to the {} {}", M::KIND.name(), meta.id())),
    }
}

impl Store {
    /// The folder of an object, whether or not it exists.
    pub(super) fn folder(&self, kind: Kind, id: &str) -> Result<PathBuf, StoreError> {
        check_id(id).map(|()| all(kind, self.files()).join(id))
    }

    /// Bytes to be kept for `value`, with a checksum.
    pub(super) fn sealed<T: Serialize>(&self, what: &str, value: &T) -> Result<Vec<u8>, StoreError> {
        meta::wrap(self.catalog_path(), what, value)
    }

    /// What [`Self::sealed`] gave.
    ///
    /// # Errors
    /// [`StoreError::Damaged`].
    pub(super) fn unsealed<T: DeserializeOwned>(
        &self,
        (kind, id): (Kind, &str),
        what: &str,
        bytes: &[u8],
    ) -> Result<T, StoreError> {
        let damaged =
            |why| StoreError::damaged(self.catalog_path(), format!("{what} of the {} {id}: {why}", kind.name()));
        meta::unwrap(bytes, what).map_err(damaged)
    }

    /// Creates an object: its record after `fill`, which makes its folder; durable on `Ok`.
    ///
    /// # Errors
    /// [`StoreError::Io`] with `AlreadyExists` where the id is taken.
    pub(super) fn create<M: RecordMeta>(
        &self,
        meta: &M,
        changes: Vec<Change>,
        fill: impl FnOnce(&Path) -> Result<(), StoreError>,
    ) -> Result<(), StoreError> {
        let (key, place) = (Key { kind: M::KIND, id: meta.id() }, self.folder(M::KIND, meta.id())?);
        let bytes = self.sealed(M::KIND.name(), meta)?;
        let record = NewRecord { key, created_ms: meta.created_ms(), phase: Phase::Creating, meta: &bytes };
        let mut all = changes;
        all.push(Change::Phase(Phase::Open));
        let created = match self.catalog().create(record) {
            Err(CatalogError::Taken) => return Err(self.failed("write", CatalogError::Taken)),
            created => created.map_err(|e| self.failed("write", e)),
        };
        let made = created.and_then(|()| self.files().publish_folder(&place, fill));
        made.and_then(|()| self.change(key, &all)).inspect_err(|_| {
            // What is left of it goes with the next start.
            if let Err(error) = self.delete(M::KIND, meta.id()) {
                tracing::warn!(%error, id = meta.id(), "what could not be created is still there");
            }
        })
    }

    /// Changes the record of an object; durable on `Ok`.
    ///
    /// # Errors
    /// Not found where it was deleted.
    pub(super) fn change(&self, key: Key<'_>, changes: &[Change]) -> Result<(), StoreError> {
        check_id(key.id)?;
        self.read_anew(key);
        match self.catalog().change(key, changes).map_err(|e| self.failed("write", e))? {
            true => Ok(()),
            false => Err(StoreError::of(self.catalog_path(), "write", std::io::ErrorKind::NotFound.into())),
        }
    }

    fn read_anew(&self, key: Key<'_>) {
        lock(&self.inner.at_start).remove(&(key.kind, key.id.to_owned()));
    }

    /// The record of an object; `None` where there is none, or where its deletion has begun.
    pub(super) fn record(&self, kind: Kind, id: &str) -> Result<Option<Record>, StoreError> {
        check_id(id)?;
        if let Some(record) = lock(&self.inner.at_start).get(&(kind, id.to_owned())) {
            return Ok(Some(record.clone()));
        }
        let found = self.catalog().record(Key { kind, id }).map_err(|e| self.failed("read", e))?;
        Ok(found.filter(|record| record.phase == Phase::Open))
    }

    /// The metadata of one object; `None` if there is none.
    ///
    /// # Errors
    /// [`StoreError::Damaged`].
    pub(crate) fn reload_meta<M: RecordMeta>(&self, id: &str) -> Result<Option<M>, StoreError> {
        let damaged = |what| StoreError::damaged(self.catalog_path(), format!("{} {id}: {what}", M::KIND.name()));
        self.record(M::KIND, id)?.map(|record| meta_of(&record).map_err(damaged)).transpose()
    }

    /// Stores the outcome of an object; durable on `Ok`.
    ///
    /// # Errors
    /// Not found where it was deleted.
    pub(crate) fn set_outcome<T: Serialize>(&self, kind: Kind, id: &str, outcome: &T) -> Result<(), StoreError> {
        let outcome = self.sealed(outcome_of(kind), outcome)?;
        self.change(Key { kind, id }, &[Change::Outcome(outcome)])
    }

    /// The outcome of an object; `None` where there is none yet.
    ///
    /// # Errors
    /// [`StoreError::Damaged`].
    pub fn outcome<T: DeserializeOwned>(&self, kind: Kind, id: &str) -> Result<Option<T>, StoreError> {
        let outcome = self.record(kind, id)?.and_then(|record| record.outcome);
        outcome.map(|bytes| self.unsealed((kind, id), outcome_of(kind), &bytes)).transpose()
    }

    /// Stores what has to be announced about an object, in place of what had to be before; durable on `Ok`.
    pub fn set_announcement<T: Serialize>(&self, kind: Kind, id: &str, message: &T) -> Result<(), StoreError> {
        self.change(Key { kind, id }, &[Change::Announcement(self.sealed(ANNOUNCEMENT, message)?)])
    }

    /// What has to be announced about an object.
    ///
    /// # Errors
    /// [`StoreError::Damaged`].
    pub fn announcement<T: DeserializeOwned>(&self, kind: Kind, id: &str) -> Result<Option<T>, StoreError> {
        let message = self.record(kind, id)?.and_then(|record| record.announcement);
        message.map(|bytes| self.unsealed((kind, id), ANNOUNCEMENT, &bytes)).transpose()
    }

    /// Deletes an object, if it exists. On `Ok` the deletion is durable; after an error it is either gone or still there as a whole.
    pub fn delete(&self, kind: Kind, id: &str) -> Result<(), StoreError> {
        let (key, folder) = (Key { kind, id }, self.folder(kind, id)?);
        self.read_anew(key);
        self.catalog().change(key, &[Change::Phase(Phase::Deleted)]).map_err(|e| self.failed("write", e))?;
        // From here on it is gone; what takes space yet goes with the next start.
        let cleared = self.files().delete_durably(&folder);
        let removed = cleared.and_then(|()| self.catalog().remove(key).map_err(|e| self.failed("write", e)));
        if let Err(error) = removed {
            tracing::warn!(%error, id, "the space of something deleted is freed at the next start only");
        }
        Ok(())
    }

    /// Notes that an object is damaged, and what; it stays so until it is deleted.
    pub fn mark_damaged(&self, kind: Kind, id: &str, what: &str) -> Result<(), StoreError> {
        self.change(Key { kind, id }, &[Change::Damage(what.to_owned())])
    }

    /// What is damaged of an object.
    pub fn damage(&self, kind: Kind, id: &str) -> Result<Option<String>, StoreError> {
        Ok(self.record(kind, id)?.and_then(|record| record.damage))
    }

    /// Bytes of an object's files; 0 where there is none.
    pub fn bytes(&self, kind: Kind, id: &str) -> Result<u64, StoreError> {
        self.files().folder_bytes(&self.folder(kind, id)?)
    }

    /// Finishes at the start what an earlier process did not live to: removes what was being created or deleted. Gives the records that are there.
    pub(super) fn tidy_records(&self, records: Vec<Record>) -> Vec<Record> {
        let (open, others): (Vec<_>, Vec<_>) = records.into_iter().partition(|record| record.phase == Phase::Open);
        for record in &others {
            if let Err(error) = self.delete(record.kind, &record.id) {
                tracing::warn!(%error, id = record.id, "what was being created or deleted takes space until a later start");
            }
        }
        open
    }

    /// The metadata of all records of a kind, oldest first. Those that cannot be read are left as they are: a newer version of the program may have
    /// written them.
    pub(super) fn metas<M: RecordMeta>(&self, records: &[Record], quarantined: &mut Vec<Quarantined>) -> Vec<M> {
        let of_kind = records.iter().filter(|record| record.kind == M::KIND);
        let read = of_kind.filter_map(|record| match meta_of(record) {
            Ok(meta) => Some(meta),
            Err(why) => {
                self.inner.keeps_contents.store(true, Relaxed);
                let why = format!("the record of the {} {:?} cannot be read: {why}", M::KIND.name(), record.id);
                let path = self.catalog_path().to_owned();
                quarantined.push(Quarantined { name: record.id.clone(), path, why });
                None
            }
        });
        read.collect()
    }

    /// Compares the folders with the records at the start. Those without a record are moved to quarantine, or removed
    /// where they
    /// are empty; those that a backup has left out because they were empty are made.
    pub(super) fn match_folders(
        &self,
        records: &[Record],
        quarantined: &mut Vec<Quarantined>,
    ) -> Result<(), StoreError> {
        let files = self.files();
        for kind in Kind::ALL {
            let mut missing: HashSet<&str> =
                records.iter().filter(|record| record.kind == kind).map(|record| &record.id[..]).collect();
            let mut strangers = Vec::new();
            for entry in files.list(all(kind, files))? {
                if !missing.remove(&*entry.name.to_string_lossy()) {
                    strangers.push(all(kind, files).join(&entry.name));
                }
            }
            for path in strangers {
                // Sessions that nobody knows any more may have content.
                self.inner.keeps_contents.store(true, Relaxed);
                if files.disk.remove_dir(&path).is_ok() {
                    continue;
                }
                let why = format!("there is no {} of this name in the catalogue", kind.name());
                match files.move_to_quarantine(&path, &why) {
                    Ok(aside) => quarantined.push(aside),
                    Err(error) => tracing::error!(%error, "what belongs to nothing could not be put aside"),
                }
            }
            let open = records.iter().filter(|record| record.kind == kind && record.phase == Phase::Open);
            for record in open.filter(|record| missing.contains(&record.id[..]) && is_session_id(&record.id)) {
                // A bucket has no folders without files.
                if !files.disk.is_elsewhere()
                    && let Err(error) = make_folder(&*files.disk, &all(kind, files).join(&record.id))
                {
                    tracing::error!(%error, id = record.id, "its folder is missing and cannot be made");
                }
            }
        }
        Ok(())
    }
}
