//! Atomic operations on files and folders: written in `tmp/`, synced and renamed into place; moved to `trash/`, then removed.

use super::disk::{Disk, DiskFile};
use super::{Quarantined, StoreError};
use std::borrow::Cow;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Instant, SystemTime, UNIX_EPOCH};

/// The root folder of a store, and the file operations on it.
#[derive(Debug)]
pub(crate) struct Files {
    pub(crate) disk: Arc<dyn Disk>,
    pub(crate) root: PathBuf,
    pub(crate) sessions: PathBuf,
    pub(crate) cages: PathBuf,
    pub(crate) recoveries: PathBuf,
    pub(crate) transfers: PathBuf,
    pub(crate) contents: PathBuf,
    pub(crate) prepared: PathBuf,
    pub(crate) trash: PathBuf,
    pub(crate) quarantine: PathBuf,
    pub(crate) tmp: PathBuf,
    /// Unique per process, so that names never collide with those of an earlier run.
    run: u128,
    next: AtomicU64,
}

impl Files {
    pub(crate) fn new(root: &Path, disk: Arc<dyn Disk>) -> Self {
        let run = SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |since| since.as_nanos());
        let [sessions, cages, recoveries, transfers, contents, prepared, trash, quarantine, tmp] =
            ["sessions", "cages", "recoveries", "transfers", "contents", "prepared", "trash", "quarantine", "tmp"]
                .map(|name| root.join(name));
        let (root, next) = (root.to_owned(), AtomicU64::new(0));
        Self {
            disk,
            root,
            sessions,
            cages,
            recoveries,
            transfers,
            contents,
            prepared,
            trash,
            quarantine,
            tmp,
            run,
            next,
        }
    }

    fn unique(&self, name: &str) -> String {
        format!("{name}.{:x}-{}", self.run, self.next.fetch_add(1, Ordering::Relaxed))
    }

    /// A path in `tmp/` that nothing else has.
    pub(crate) fn temporary(&self, name: &str) -> PathBuf {
        self.tmp.join(self.unique(name))
    }

    /// Creates `path` with `bytes` and syncs the file, but not its folder.
    pub(crate) fn write_new(&self, path: &Path, bytes: &[u8]) -> Result<(), StoreError> {
        let file = self.create(path)?;
        file.write_all_at(bytes, 0).map_err(|e| StoreError::of(path, "write", e))?;
        self.sync_file(&*file, path)
    }

    pub(crate) fn create(&self, path: &Path) -> Result<Arc<dyn DiskFile>, StoreError> {
        self.disk.create_new(path).map_err(|e| StoreError::of(path, "create", e))
    }

    pub(crate) fn sync_file(&self, file: &dyn DiskFile, path: &Path) -> Result<(), StoreError> {
        timed(|| file.sync_data()).map_err(|e| StoreError::of(path, "sync", e))
    }

    pub(crate) fn sync_dir(&self, path: &Path) -> Result<(), StoreError> {
        timed(|| self.disk.sync_dir(path)).map_err(|e| StoreError::of(path, "sync", e))
    }

    /// Atomically replaces the content of `path`; durable on `Ok`.
    pub(crate) fn replace(&self, path: &Path, bytes: &[u8]) -> Result<(), StoreError> {
        let temporary = self.temporary("file");
        self.write_new(&temporary, bytes)
            .and_then(|()| self.publish(&temporary, path))
            .inspect_err(|_| self.discard(&temporary))
    }

    /// Moves a synced file or folder to its place, durably.
    pub(crate) fn publish(&self, from: &Path, to: &Path) -> Result<(), StoreError> {
        self.disk.rename(from, to).map_err(|e| StoreError::of(to, "put in place", e))?;
        self.sync_dir(parent(to))
    }

    /// Atomically creates a folder with the content that `fill` writes; durable on `Ok`. Fails with `AlreadyExists` if the name is taken.
    pub(crate) fn publish_folder(
        &self,
        place: &Path,
        fill: impl FnOnce(&Path) -> Result<(), StoreError>,
    ) -> Result<(), StoreError> {
        let staging = self.temporary(&name_of(place));
        let prepare = || {
            self.disk.create_dir(&staging).map_err(|e| StoreError::of(&staging, "create", e))?;
            fill(&staging)?;
            self.sync_dir(&staging)
        };
        prepare().inspect_err(|_| self.discard(&staging))?;
        if let Err(error) = self.disk.rename(&staging, place) {
            self.discard(&staging);
            let taken = matches!(error.kind(), io::ErrorKind::DirectoryNotEmpty | io::ErrorKind::AlreadyExists);
            let error = if taken { io::ErrorKind::AlreadyExists.into() } else { error };
            return Err(StoreError::of(place, "create", error));
        }
        self.sync_dir(parent(place)).inspect_err(|_| {
            if let Err(error) = self.delete_durably(place) {
                tracing::warn!(%error, path = %place.display(), "what could not be created is still there");
            }
        })
    }

    /// Removes a temporary file or folder, best effort: what remains is removed when the store is opened again.
    pub(crate) fn discard(&self, path: &Path) {
        if let Err(error) = self.remove_tree(path)
            && !error.is_not_found()
        {
            tracing::debug!(%error, "a temporary stays until the next start");
        }
    }

    /// Whether a file or folder exists at `path`.
    pub(crate) fn exists(&self, path: &Path) -> Result<bool, StoreError> {
        self.open(path).map(|file| file.is_some())
    }

    /// Opens a file for reading; `None` if it does not exist.
    pub(crate) fn open(&self, path: &Path) -> Result<Option<Arc<dyn DiskFile>>, StoreError> {
        unless_missing(self.disk.open(path)).map_err(|e| StoreError::of(path, "open", e))
    }

    /// As [`Self::open`], where a missing file is damage.
    pub(crate) fn open_expected(&self, path: &Path) -> Result<Arc<dyn DiskFile>, StoreError> {
        self.open(path)?.ok_or_else(|| StoreError::damaged(path, "it is missing"))
    }

    /// Removes a file, unless it does not exist.
    pub(crate) fn remove_file(&self, path: &Path) -> Result<(), StoreError> {
        let removed = unless_missing(self.disk.remove_file(path));
        removed.map(|_| ()).map_err(|e| StoreError::of(path, "remove", e))
    }

    /// Moves a file or folder to `trash/`, durably, then removes it. On `Ok` it does not come back, even if removing it has to be finished
    /// at the next start. A missing path is no error.
    pub(crate) fn delete_durably(&self, path: &Path) -> Result<(), StoreError> {
        let away = self.trash.join(self.unique(&name_of(path)));
        // Where it is missing, an earlier call may have moved it without syncing; the syncs below make up for that.
        let moved = unless_missing(self.disk.rename(path, &away)).map_err(|e| StoreError::of(path, "delete", e))?;
        self.sync_dir(&self.trash)?;
        self.sync_dir(parent(path))?;
        if moved.is_some()
            && let Err(error) = self.remove_tree(&away)
        {
            tracing::warn!(%error, "the space of something deleted is freed at the next start only");
        }
        Ok(())
    }

    /// Moves a damaged file or folder to `quarantine/` and writes a note about the damage beside it.
    pub(crate) fn move_to_quarantine(&self, path: &Path, why: &str) -> Result<Quarantined, StoreError> {
        let mut target = self.quarantine.join(path.file_name().unwrap_or_default());
        if self.exists(&target)? {
            target = self.quarantine.join(self.unique(&name_of(path)));
        }
        self.disk.rename(path, &target).map_err(|e| StoreError::of(path, "quarantine", e))?;
        self.sync_dir(&self.quarantine)?;
        self.sync_dir(parent(path))?;
        let mut note = target.clone().into_os_string();
        note.push(".why.txt");
        if let Err(error) = self.write_new(Path::new(&note), format!("{why}\n").as_bytes()) {
            tracing::debug!(%error, "no note beside something quarantined");
        }
        Ok(Quarantined { name: name_of(path).into_owned(), path: target, why: why.to_owned() })
    }

    /// Removes a file or a folder recursively.
    pub(crate) fn remove_tree(&self, path: &Path) -> Result<(), StoreError> {
        // EISDIR, or EPERM under POSIX, for a folder; the calls below report any other error.
        if unless_missing(self.disk.remove_file(path)).is_ok() {
            return Ok(());
        }
        self.clear(path)?;
        self.disk.remove_dir(path).map_err(|e| StoreError::of(path, "remove", e))
    }

    /// Removes everything in a folder.
    pub(crate) fn clear(&self, folder: &Path) -> Result<(), StoreError> {
        for entry in self.list(folder)? {
            self.remove_tree(&folder.join(entry.name))?;
        }
        Ok(())
    }

    pub(crate) fn list(&self, folder: &Path) -> Result<Vec<super::disk::Entry>, StoreError> {
        self.disk.list(folder).map_err(|e| StoreError::of(folder, "list", e))
    }

    /// Reads a whole file; `None` if it does not exist. A length above `limit` is reported as damage before memory is allocated.
    pub(crate) fn read(&self, path: &Path, limit: u64) -> Result<Option<Vec<u8>>, StoreError> {
        let Some(file) = self.open(path)? else { return Ok(None) };
        let bytes = file.length().map_err(|e| StoreError::of(path, "read", e))?;
        if bytes > limit {
            return Err(StoreError::damaged(path, format!("it has {bytes} bytes where {limit} are the most")));
        }
        let mut content = vec![0; bytes as usize];
        file.read_exact_at(&mut content, 0).map_err(|e| StoreError::of(path, "read", e))?;
        Ok(Some(content))
    }

    /// Reads a file of this length and this digest, BLAKE3, hexadecimal; anything else is damage.
    pub(crate) fn read_verified(&self, path: &Path, bytes: u64, digest: &str) -> Result<Vec<u8>, StoreError> {
        let found = self.read(path, bytes)?.ok_or_else(|| StoreError::damaged(path, "it is missing"))?;
        if found.len() as u64 != bytes || blake3::hash(&found).to_hex().as_str() != digest {
            return Err(StoreError::damaged(path, "its content does not match its checksum"));
        }
        Ok(found)
    }

    /// Bytes of the files in a folder; 0 where there is none.
    pub(crate) fn folder_bytes(&self, folder: &Path) -> Result<u64, StoreError> {
        let listed = unless_missing(self.disk.list(folder)).map_err(|e| StoreError::of(folder, "list", e))?;
        Ok(listed.map_or(0, |all| all.iter().map(|entry| entry.bytes).sum()))
    }
}

/// `None` where there is no such file.
fn unless_missing<T>(outcome: io::Result<T>) -> io::Result<Option<T>> {
    match outcome {
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(None),
        other => other.map(Some),
    }
}

/// Name of a file or folder.
fn name_of(path: &Path) -> Cow<'_, str> {
    path.file_name().map_or_else(|| "unnamed".into(), |name| name.to_string_lossy())
}

/// The parent folder; `.` for a bare name.
pub(crate) fn parent(path: &Path) -> &Path {
    match path.parent() {
        Some(parent) if parent != Path::new("") => parent,
        _ => Path::new("."),
    }
}

/// Runs a sync and records how long it took.
pub(crate) fn timed(sync: impl FnOnce() -> io::Result<()>) -> io::Result<()> {
    let clock = Instant::now();
    let result = sync();
    metrics::histogram!("cager_fsync_seconds").record(clock.elapsed().as_secs_f64());
    result
}
