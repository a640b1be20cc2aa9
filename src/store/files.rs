//! Atomic operations on files and folders: written in `tmp/`, synced and renamed into place; moved to `trash/`, then removed.

use super::disk::{Disk, DiskFile};
use super::{Quarantined, StoreError};
use std::ffi::OsString;
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
    /// Unique per process, so that names never collide with those of an earlier run.
    run: u128,
    next: AtomicU64,
}

impl Files {
    pub(crate) fn new(root: &Path, disk: Arc<dyn Disk>) -> Self {
        let run = SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |since| since.as_nanos());
        Self { disk, root: root.to_owned(), run, next: AtomicU64::new(0) }
    }

    pub(crate) fn sessions(&self) -> PathBuf {
        self.root.join("sessions")
    }

    pub(crate) fn session(&self, id: &str) -> PathBuf {
        self.sessions().join(id)
    }

    pub(crate) fn cages(&self) -> PathBuf {
        self.root.join("cages")
    }

    pub(crate) fn cage_job(&self, id: &str) -> PathBuf {
        self.cages().join(id)
    }

    pub(crate) fn contents(&self) -> PathBuf {
        self.root.join("contents")
    }

    pub(crate) fn prepared(&self) -> PathBuf {
        self.root.join("prepared")
    }

    pub(crate) fn trash(&self) -> PathBuf {
        self.root.join("trash")
    }

    pub(crate) fn quarantine(&self) -> PathBuf {
        self.root.join("quarantine")
    }

    pub(crate) fn tmp(&self) -> PathBuf {
        self.root.join("tmp")
    }

    fn unique(&self, name: &str) -> String {
        format!("{name}.{:x}-{}", self.run, self.next.fetch_add(1, Ordering::Relaxed))
    }

    /// A path in `tmp/` that nothing else has.
    pub(crate) fn temporary(&self, name: &str) -> PathBuf {
        self.tmp().join(self.unique(name))
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
        let name = place.file_name().map_or_else(|| "unnamed".into(), |name| name.to_string_lossy());
        let staging = self.temporary(&name);
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
        match self.disk.open(path) {
            Ok(_) => Ok(true),
            Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(false),
            Err(error) => Err(StoreError::of(path, "open", error)),
        }
    }

    /// Moves a file or folder to `trash/`, durably, then removes it. On `Ok` it does not come back, even if removing it has to be finished
    /// at the next start. A missing path is no error.
    pub(crate) fn delete_durably(&self, path: &Path) -> Result<(), StoreError> {
        let trash = self.trash();
        let name = path.file_name().map_or_else(|| "unnamed".into(), |name| name.to_string_lossy());
        let away = trash.join(self.unique(&name));
        let moved = match self.disk.rename(path, &away) {
            Ok(()) => true,
            // An earlier call may have moved it without syncing; the syncs below make up for that.
            Err(error) if error.kind() == io::ErrorKind::NotFound => false,
            Err(error) => return Err(StoreError::of(path, "delete", error)),
        };
        self.sync_dir(&trash)?;
        self.sync_dir(parent(path))?;
        if moved && let Err(error) = self.remove_tree(&away) {
            tracing::warn!(%error, "the space of something deleted is freed at the next start only");
        }
        Ok(())
    }

    /// Moves a damaged file or folder to `quarantine/` and writes a note about the damage beside it.
    pub(crate) fn move_to_quarantine(&self, path: &Path, why: &str) -> Result<Quarantined, StoreError> {
        let folder = self.quarantine();
        let name: OsString = path.file_name().map_or_else(|| "unnamed".into(), OsString::from);
        let mut target = folder.join(&name);
        if self.exists(&target)? {
            target = folder.join(self.unique(&name.to_string_lossy()));
        }
        self.disk.rename(path, &target).map_err(|e| StoreError::of(path, "quarantine", e))?;
        self.sync_dir(&folder)?;
        self.sync_dir(parent(path))?;
        let mut note = target.clone().into_os_string();
        note.push(".why.txt");
        if let Err(error) = self.write_new(Path::new(&note), format!("{why}\n").as_bytes()) {
            tracing::debug!(%error, "no note beside something quarantined");
        }
        Ok(Quarantined { name: name.to_string_lossy().into_owned(), path: target, why: why.to_owned() })
    }

    /// Removes a file or a folder recursively.
    pub(crate) fn remove_tree(&self, path: &Path) -> Result<(), StoreError> {
        match self.disk.remove_file(path) {
            Ok(()) => return Ok(()),
            Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(()),
            // EISDIR, or EPERM under POSIX; the calls below report the error unless it is a folder.
            Err(_) => {}
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
        let file = match self.disk.open(path) {
            Ok(file) => file,
            Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(None),
            Err(error) => return Err(StoreError::of(path, "open", error)),
        };
        let bytes = file.length().map_err(|e| StoreError::of(path, "read", e))?;
        if bytes > limit {
            return Err(StoreError::damaged(path, format!("it has {bytes} bytes where {limit} are the most")));
        }
        let mut content = vec![0; bytes as usize];
        file.read_exact_at(&mut content, 0).map_err(|e| StoreError::of(path, "read", e))?;
        Ok(Some(content))
    }
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
