//! Prepared solvers on disk, by content key: a cache that survives restarts.

use super::disk::DiskFile;
use super::solver_file;
use super::{ContentKey, Store, StoreError};
use cager_core::inversion::Solver;
use std::ffi::OsStr;
use std::io;
use std::path::{Path, PathBuf};

impl Store {
    fn prepared_path(&self, key: &ContentKey) -> PathBuf {
        self.files().prepared.join(format!("{key}.solver"))
    }

    /// Stores a prepared solver; durable on `Ok`, which has the file's bytes. An existing file is kept.
    pub fn put_prepared(&self, key: &ContentKey, solver: &Solver) -> Result<u64, StoreError> {
        let files = self.files();
        let place = self.prepared_path(key);
        let length = |file: &dyn DiskFile| file.length().map_err(|e| StoreError::of(&place, "read", e));
        if let Some(file) = files.open(&place)? {
            files.sync_dir(&files.prepared)?;
            return length(&*file);
        }
        let staging = files.temporary("solver");
        let make = || {
            let file = files.create(&staging)?;
            solver_file::write(&*file, key, solver).map_err(|e| StoreError::of(&place, "write", e))?;
            files.sync_file(&*file, &place)?;
            // One that another thread has put there meanwhile is as good.
            files.publish(&staging, &place)?;
            self.used(&place);
            length(&*file)
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

    /// Keys and bytes of the files, least recently used first.
    pub fn prepared_files(&self) -> Result<Vec<(ContentKey, u64)>, StoreError> {
        let mut entries = self.files().list(&self.files().prepared)?;
        entries.sort_by(|a, b| (a.modified, &a.name).cmp(&(b.modified, &b.name)));
        let key = |name: &OsStr| name.to_str()?.strip_suffix(".solver")?.parse().ok();
        Ok(entries.iter().filter_map(|entry| Some((key(&entry.name)?, entry.bytes))).collect())
    }

    /// Removes a file, unless it does not exist. Not synced: one that reappears after a power cut is found at the next start.
    pub fn remove_prepared(&self, key: &ContentKey) -> Result<(), StoreError> {
        self.files().remove_file(&self.prepared_path(key))
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
