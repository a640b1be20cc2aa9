//! Files that come in pieces: written to `tmp/` with their digest, then moved into place or removed.

use super::disk::DiskFile;
use super::{Store, StoreError};
use std::io::{self, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// A file being written; removed on drop unless it was moved into place.
#[derive(Debug)]
pub struct Spool {
    store: Store,
    path: PathBuf,
    file: Arc<dyn DiskFile>,
    bytes: u64,
    digest: blake3::Hasher,
    /// Set after a failed write: the file has a gap.
    broken: bool,
    taken: bool,
}

impl Store {
    /// Where nothing is yet, for what is needed for a moment; what is left there goes with the next start.
    pub(crate) fn scratch(&self) -> PathBuf {
        self.files().temporary("scratch")
    }

    /// A new empty file for what arrives.
    pub fn spool(&self) -> Result<Spool, StoreError> {
        let path = self.files().temporary("spool");
        let file = self.files().create(&path)?;
        Ok(Spool {
            store: self.clone(),
            path,
            file,
            bytes: 0,
            digest: blake3::Hasher::new(),
            broken: false,
            taken: false,
        })
    }
}

impl Spool {
    /// Appends bytes. After an error all further calls fail.
    pub fn append(&mut self, bytes: &[u8]) -> Result<(), StoreError> {
        let written = match self.broken {
            true => Err(io::Error::other("an earlier write failed")),
            false => self.file.write_all_at(bytes, self.bytes).inspect_err(|_| self.broken = true),
        };
        written.map_err(|e| StoreError::of(&self.path, "write", e))?;
        self.digest.update(bytes);
        self.bytes += bytes.len() as u64;
        Ok(())
    }

    /// Bytes so far.
    pub fn bytes(&self) -> u64 {
        self.bytes
    }

    /// Digest of the bytes so far, BLAKE3.
    pub fn digest(&self) -> blake3::Hash {
        self.digest.finalize()
    }

    /// Where it is.
    pub(crate) fn path(&self) -> &Path {
        &self.path
    }

    /// A reader of the bytes written so far.
    pub fn stored(&self) -> StoredFile {
        StoredFile { file: Arc::clone(&self.file), bytes: self.bytes, at: 0 }
    }

    /// Syncs the file and moves it into a folder, which the caller syncs.
    pub(super) fn move_to(mut self, place: &Path) -> Result<(), StoreError> {
        let files = self.store.files();
        files.sync_file(&*self.file, &self.path)?;
        files.disk.rename(&self.path, place).map_err(|e| StoreError::of(place, "put in place", e))?;
        self.taken = true;
        Ok(())
    }
}

impl Write for Spool {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.append(bytes)?;
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

impl Drop for Spool {
    fn drop(&mut self) {
        if !self.taken {
            discard(&self.store, &self.path);
        }
    }
}

/// Removes a temporary file or folder. That may ask the database, for which no asynchronous task may wait.
pub(super) fn discard(store: &Store, path: &Path) {
    let (store, path) = (store.clone(), path.to_owned());
    let discard = move || store.files().discard(&path);
    match tokio::runtime::Handle::try_current() {
        Ok(runtime) => drop(runtime.spawn_blocking(discard)),
        Err(_) => discard(),
    }
}

/// A stored file open for reading.
#[derive(Clone, Debug)]
pub struct StoredFile {
    file: Arc<dyn DiskFile>,
    bytes: u64,
    at: u64,
}

impl StoredFile {
    pub(super) fn open(file: Arc<dyn DiskFile>) -> io::Result<Self> {
        let bytes = file.length()?;
        Ok(Self { file, bytes, at: 0 })
    }

    /// Its length.
    pub fn bytes(&self) -> u64 {
        self.bytes
    }
}

impl Read for StoredFile {
    fn read(&mut self, out: &mut [u8]) -> io::Result<usize> {
        let wanted = out.len().min(usize::try_from(self.bytes - self.at).unwrap_or(usize::MAX));
        let read = self.file.read_at(&mut out[..wanted], self.at)?;
        self.at += read as u64;
        Ok(read)
    }
}

impl Seek for StoredFile {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        let place = match to {
            SeekFrom::Start(at) => Some(at),
            SeekFrom::End(by) => self.bytes.checked_add_signed(by),
            SeekFrom::Current(by) => self.at.checked_add_signed(by),
        };
        // Seeking beyond the end stays at the end.
        self.at = place.ok_or(io::ErrorKind::InvalidInput)?.min(self.bytes);
        Ok(self.at)
    }
}
