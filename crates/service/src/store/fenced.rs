//! A data folder whose catalogue is in a database: what replaces or removes something there asks first whether this process still has it. A process that was
//! cut off or stood still would otherwise tidy away what the one that took over has stored.

use super::disk::{Disk, DiskFile, Entry};
use cager_store::{Catalog, CatalogError};
use std::fs::File;
use std::io;
use std::path::Path;
use std::sync::Arc;

#[derive(Debug)]
pub(super) struct FencedDisk {
    pub(super) disk: Arc<dyn Disk>,
    pub(super) catalog: Arc<dyn Catalog>,
    /// What is in it has names of its own, which no other process has.
    pub(super) temporary: Box<Path>,
}

impl FencedDisk {
    /// Whether something may be done to `path`.
    fn check(&self, path: &Path) -> io::Result<()> {
        if path.starts_with(&self.temporary) {
            return Ok(());
        }
        self.catalog.check_owner().map_err(io::Error::other)
    }
}

impl Disk for FencedDisk {
    fn create_new(&self, path: &Path) -> io::Result<Arc<dyn DiskFile>> {
        self.disk.create_new(path)
    }

    fn open(&self, path: &Path) -> io::Result<Arc<dyn DiskFile>> {
        self.disk.open(path)
    }

    fn open_for_writing(&self, path: &Path) -> io::Result<Arc<dyn DiskFile>> {
        self.disk.open_for_writing(path)
    }

    fn create_dir(&self, path: &Path) -> io::Result<()> {
        self.disk.create_dir(path)
    }

    fn rename(&self, from: &Path, to: &Path) -> io::Result<()> {
        self.check(from)?;
        self.check(to)?;
        self.disk.rename(from, to)
    }

    fn remove_file(&self, path: &Path) -> io::Result<()> {
        self.check(path)?;
        self.disk.remove_file(path)
    }

    fn remove_dir(&self, path: &Path) -> io::Result<()> {
        self.check(path)?;
        self.disk.remove_dir(path)
    }

    fn list(&self, path: &Path) -> io::Result<Vec<Entry>> {
        self.disk.list(path)
    }

    fn sync_dir(&self, path: &Path) -> io::Result<()> {
        self.disk.sync_dir(path)
    }

    fn touch(&self, path: &Path) -> io::Result<()> {
        self.disk.touch(path)
    }

    fn lock(&self, path: &Path) -> io::Result<Option<File>> {
        self.disk.lock(path)
    }

    fn free_bytes(&self, path: &Path) -> io::Result<u64> {
        self.disk.free_bytes(path)
    }

    fn catalog(&self, path: &Path) -> Result<Arc<dyn Catalog>, CatalogError> {
        self.disk.catalog(path)
    }

    fn bring(&self, path: &Path) -> io::Result<()> {
        self.disk.bring(path)
    }

    fn is_elsewhere(&self) -> bool {
        self.disk.is_elsewhere()
    }

    fn probe(&self) -> io::Result<()> {
        self.disk.probe()
    }
}
