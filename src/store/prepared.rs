//! Prepared solvers on disk, by content key: a cache that survives restarts.

use super::solver_file;
use super::{ContentKey, Store, StoreError};
use cager_core::inversion::Solver;
use std::io;
use std::path::{Path, PathBuf};

impl Store {
    fn prepared_path(&self, key: &ContentKey) -> PathBuf {
        self.files().prepared.join(format!("{key}.solver"))
    }

    /// Stores a prepared solver; durable on `Ok`. An existing file is kept.
    pub fn put_prepared(&self, key: &ContentKey, solver: &Solver) -> Result<(), StoreError> {
        let files = self.files();
        let place = self.prepared_path(key);
        if files.exists(&place)? {
            return files.sync_dir(&files.prepared);
        }
        let staging = files.temporary("solver");
        let make = || {
            let file = files.create(&staging)?;
            solver_file::write(&*file, key, solver).map_err(|e| StoreError::of(&place, "write", e))?;
            files.sync_file(&*file, &place)?;
            // One that another thread has put there meanwhile is as good.
            files.publish(&staging, &place)?;
            self.used(&place);
            Ok(())
        };
        make().inspect_err(|_| files.discard(&staging))
    }

    /// Whether a file for the key exists; it is not verified.
    pub fn has_prepared(&self, key: &ContentKey) -> bool {
        self.files().exists(&self.prepared_path(key)).unwrap_or(false)
    }

    /// Loads a prepared solver, bitwise equal to the stored one; `None` if there is none. A damaged file is moved to quarantine, and a file
    /// of another format version is removed; both count as none.
    pub fn prepared(&self, key: &ContentKey) -> Result<Option<Solver>, StoreError> {
        let place = self.prepared_path(key);
        let Some(file) = self.files().open(&place)? else { return Ok(None) };
        let found = match solver_file::read(&*file, key) {
            Ok(Some(solver)) => Ok(solver),
            Ok(None) => {
                tracing::debug!(%key, "a solver file has another format version; the solver is prepared again");
                return self.files().remove_file(&place).map(|()| None);
            }
            Err(error) if error.kind() == io::ErrorKind::InvalidData => {
                Err(StoreError::damaged(&place, error.to_string()))
            }
            Err(error) => Err(StoreError::of(&place, "read", error)),
        };
        match self.quarantine_if_damaged(&place, found) {
            Ok(solver) => {
                self.used(&place);
                Ok(Some(solver))
            }
            Err(error @ StoreError::Damaged { .. }) => {
                tracing::warn!(%error, %key, "a damaged solver file is ignored; the solver is prepared again");
                Ok(None)
            }
            Err(error) => Err(error),
        }
    }

    /// Removes prepared solvers, least recently used first, until they take at most `budget_bytes`; returns the number of bytes freed.
    pub fn trim_prepared(&self, budget_bytes: u64) -> Result<u64, StoreError> {
        let files = self.files();
        let mut entries = files.list(&files.prepared)?;
        entries.sort_by(|a, b| (a.modified, &a.name).cmp(&(b.modified, &b.name)));
        let total: u64 = entries.iter().map(|entry| entry.bytes).sum();
        let mut freed = 0;
        for entry in entries {
            if total - freed <= budget_bytes {
                break;
            }
            files.remove_file(&files.prepared.join(&entry.name))?;
            freed += entry.bytes;
        }
        // Not synced: a file that reappears after a power cut is removed by the next trim.
        Ok(freed)
    }

    /// Updates the time of last use, for the eviction order after a restart.
    fn used(&self, place: &Path) {
        if let Err(error) = self.files().disk.touch(place) {
            tracing::debug!(%error, path = %place.display(), "the last use was not noted");
        }
    }

    /// Moves the content or solver file at `place` to quarantine if `found` says that it is damaged.
    pub(super) fn quarantine_if_damaged<T>(&self, place: &Path, found: Result<T, StoreError>) -> Result<T, StoreError> {
        if let Err(error @ StoreError::Damaged { .. }) = &found {
            match self.files().move_to_quarantine(place, &error.to_string()) {
                Err(error) if !error.is_not_found() => return Err(error),
                _ => {}
            }
        }
        found
    }
}
