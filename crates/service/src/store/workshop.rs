//! Results of a job while they are made: in a folder of their own in `tmp/`, then moved into the job's.

use super::{Kind, Store, StoreError, StoredPart, spool};
use serde::Serialize;
use std::fs::File;
use std::io;
use std::path::{Path, PathBuf};

/// A folder for what is being made; removed when it is dropped.
#[derive(Debug)]
pub struct Workshop {
    store: Store,
    path: PathBuf,
}

impl Workshop {
    /// Where it is.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Writes a file into it.
    pub fn write(&self, name: &str, bytes: &[u8]) -> Result<(), StoreError> {
        self.store.files().write_new(&self.path.join(name), bytes)
    }

    /// What a file in it is.
    ///
    /// # Errors
    /// It cannot be read.
    pub(crate) fn described(&self, name: &str) -> io::Result<StoredPart> {
        let file = File::open(self.path.join(name))?;
        let bytes = file.metadata()?.len();
        let mut digest = blake3::Hasher::new();
        digest.update_reader(file)?;
        Ok(StoredPart { name: name.to_owned(), bytes, blake3: digest.finalize().to_hex().to_string() })
    }
}

impl Drop for Workshop {
    fn drop(&mut self) {
        spool::discard(&self.store, &self.path);
    }
}

impl Store {
    /// A new folder for what is being made.
    pub fn workshop(&self) -> Result<Workshop, StoreError> {
        let path = self.files().temporary("workshop");
        self.files().disk.create_dir(&path).map_err(|e| StoreError::of(&path, "create", e))?;
        Ok(Workshop { store: self.clone(), path })
    }

    /// Takes results out of a workshop and stores the outcome; durable on `Ok`. After an error it can be tried again.
    ///
    /// # Errors
    /// Not found where the job was deleted.
    pub(crate) fn finish_job<T: Serialize>(
        &self,
        kind: Kind,
        id: &str,
        outcome: &T,
        results: Option<(&Workshop, &[StoredPart])>,
    ) -> Result<(), StoreError> {
        let (files, folder) = (self.files(), self.folder(kind, id)?);
        if let Some((workshop, parts)) = results {
            for part in parts {
                let (made, place) = (workshop.path.join(&part.name), folder.join(&part.name));
                if !files.exists(&made)? && files.exists(&place)? {
                    // By an earlier try.
                    continue;
                }
                let moved = files.disk.rename(&made, &place);
                moved.map_err(|e| StoreError::of(&place, "put in place", e))?;
            }
        }
        files.sync_dir(&folder)?;
        self.set_outcome(kind, id, outcome)
    }
}
