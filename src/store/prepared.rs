//! Prepared solvers by the digest of what they were prepared from: a cache that outlives the process.

use super::solver_file;
use super::{ContentKey, Store, StoreError};
use cager_core::inversion::Solver;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::{MutexGuard, PoisonError};

impl Store {
    fn prepared_path(&self, key: &ContentKey) -> PathBuf {
        self.files().prepared().join(format!("{key}.solver"))
    }

    /// Keeps a prepared solver, durably on Ok. Create-only: where the key is there already, nothing changes.
    ///
    /// # Errors
    /// [`StoreError::Full`], or what the system says.
    pub fn put_prepared(&self, key: &ContentKey, solver: &Solver) -> Result<(), StoreError> {
        let files = self.files();
        let place = self.prepared_path(key);
        if files.exists(&place)? {
            return files.sync_dir(&files.prepared());
        }
        let aside = files.temporary("solver");
        let make = || {
            let file = files.create(&aside)?;
            solver_file::write(&*file, key, solver).map_err(|e| StoreError::of(&place, "write", e))?;
            files.sync_file(&*file, &place)?;
            let _one_at_a_time = self.publishing();
            if files.exists(&place)? {
                files.discard(&aside);
                return Ok(());
            }
            files.publish(&aside, &place)?;
            self.used(&place);
            Ok(())
        };
        make().inspect_err(|_| files.discard(&aside))
    }

    /// Whether there is a prepared solver, as far as its name says.
    pub fn has_prepared(&self, key: &ContentKey) -> bool {
        self.files().exists(&self.prepared_path(key)).unwrap_or(false)
    }

    /// A prepared solver, the same to the bit; None where there is none. A damaged one is quarantined and counts as none; one of
    /// another version of the format makes room for that of this version.
    ///
    /// # Errors
    /// What the system says.
    pub fn prepared(&self, key: &ContentKey) -> Result<Option<Solver>, StoreError> {
        let place = self.prepared_path(key);
        let file = match self.files().disk.open(&place) {
            Ok(file) => file,
            Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(None),
            Err(error) => return Err(StoreError::of(&place, "open", error)),
        };
        let found = match solver_file::read(&*file, key) {
            Ok(Some(solver)) => Ok(solver),
            Ok(None) => {
                tracing::debug!(%key, "a stored solver is of another version of the format and is prepared anew");
                self.forget_prepared(&place)?;
                return Ok(None);
            }
            Err(error) if error.kind() == io::ErrorKind::InvalidData => {
                Err(StoreError::damaged(&place, error.to_string()))
            }
            Err(error) => Err(StoreError::of(&place, "read", error)),
        };
        match self.set_aside_if_damaged(&place, found) {
            Ok(solver) => {
                self.used(&place);
                Ok(Some(solver))
            }
            Err(error @ StoreError::Damaged { .. }) => {
                tracing::warn!(%error, %key, "a prepared solver is left out and prepared anew");
                Ok(None)
            }
            Err(error) => Err(error),
        }
    }

    fn forget_prepared(&self, place: &Path) -> Result<(), StoreError> {
        let _one_at_a_time = self.publishing();
        match self.files().disk.remove_file(place) {
            Err(error) if error.kind() != io::ErrorKind::NotFound => Err(StoreError::of(place, "remove", error)),
            _ => Ok(()),
        }
    }

    /// Removes prepared solvers, least recently used first, until they take `budget_bytes` at most; gives the bytes freed.
    ///
    /// # Errors
    /// What the system says.
    pub fn trim_prepared(&self, budget_bytes: u64) -> Result<u64, StoreError> {
        let files = self.files();
        let folder = files.prepared();
        let mut entries = files.list(&folder)?;
        entries.sort_by(|a, b| (a.modified, &a.name).cmp(&(b.modified, &b.name)));
        let total: u64 = entries.iter().map(|entry| entry.bytes).sum();
        let mut freed = 0;
        for entry in entries {
            if total - freed <= budget_bytes {
                break;
            }
            let path = folder.join(&entry.name);
            match files.disk.remove_file(&path) {
                Ok(()) => freed += entry.bytes,
                Err(error) if error.kind() == io::ErrorKind::NotFound => freed += entry.bytes,
                Err(error) => return Err(StoreError::of(&path, "remove", error)),
            }
        }
        // Not synced: one that comes back after a power cut is removed at the next trim.
        Ok(freed)
    }

    /// Notes the use where the next process finds it too.
    fn used(&self, place: &Path) {
        if let Err(error) = self.files().disk.touch(place) {
            tracing::debug!(%error, path = %place.display(), "the last use was not noted");
        }
    }

    pub(super) fn publishing(&self) -> MutexGuard<'_, ()> {
        // It guards no data, so a thread that died holding it left nothing half done.
        self.inner.publishing.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Moves what was found damaged out of the way of a fresh one.
    pub(super) fn set_aside_if_damaged<T>(&self, place: &Path, found: Result<T, StoreError>) -> Result<T, StoreError> {
        if let Err(error @ StoreError::Damaged { .. }) = &found {
            let _one_at_a_time = self.publishing();
            match self.files().set_aside(place, &error.to_string()) {
                Err(error) if !error.is_not_found() => return Err(error),
                _ => {}
            }
        }
        found
    }
}
