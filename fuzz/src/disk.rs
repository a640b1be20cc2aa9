//! A disk in memory, so that what is stored can be any bytes.

use cager_service::store::disk::{Disk, DiskFile, Entry};
use cager_store::{Catalog, CatalogError, Key, SqliteCatalog};
use std::collections::BTreeMap;
use std::fs::File;
use std::io::{self, ErrorKind};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::SystemTime;

/// Files by their paths. A folder is there as soon as somebody made it, and is never missed.
#[derive(Clone, Debug, Default)]
pub(crate) struct MemoryDisk(Arc<Mutex<BTreeMap<PathBuf, Option<Arc<MemoryFile>>>>>);

#[derive(Debug, Default)]
struct MemoryFile(Mutex<Vec<u8>>);

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl MemoryDisk {
    /// Puts a file there.
    pub(crate) fn put(&self, path: &Path, bytes: &[u8]) {
        lock(&self.0).insert(path.to_owned(), Some(Arc::new(MemoryFile(Mutex::new(bytes.to_vec())))));
    }

    /// A file's bytes.
    pub(crate) fn get(&self, path: &Path) -> Option<Vec<u8>> {
        let file = lock(&self.0).get(path).cloned().flatten()?;
        let bytes = lock(&file.0).clone();
        Some(bytes)
    }
}

impl Disk for MemoryDisk {
    fn create_new(&self, path: &Path) -> io::Result<Arc<dyn DiskFile>> {
        if lock(&self.0).contains_key(path) {
            return Err(ErrorKind::AlreadyExists.into());
        }
        self.put(path, &[]);
        self.open(path)
    }

    fn open(&self, path: &Path) -> io::Result<Arc<dyn DiskFile>> {
        match lock(&self.0).get(path) {
            Some(Some(file)) => Ok(file.clone()),
            Some(None) => Ok(Arc::new(MemoryFile::default())),
            None => Err(ErrorKind::NotFound.into()),
        }
    }

    fn open_for_writing(&self, path: &Path) -> io::Result<Arc<dyn DiskFile>> {
        self.open(path)
    }

    fn create_dir(&self, path: &Path) -> io::Result<()> {
        let mut files = lock(&self.0);
        if files.contains_key(path) {
            return Err(ErrorKind::AlreadyExists.into());
        }
        files.insert(path.to_owned(), None);
        Ok(())
    }

    fn rename(&self, from: &Path, to: &Path) -> io::Result<()> {
        let mut files = lock(&self.0);
        let moved: Vec<PathBuf> = files.keys().filter(|path| path.starts_with(from)).cloned().collect();
        if moved.is_empty() {
            return Err(ErrorKind::NotFound.into());
        }
        for path in moved {
            let node = files.remove(&path).flatten();
            let below = path.strip_prefix(from).unwrap_or(Path::new(""));
            let place = if below == Path::new("") { to.to_owned() } else { to.join(below) };
            files.insert(place, node);
        }
        Ok(())
    }

    fn remove_file(&self, path: &Path) -> io::Result<()> {
        let mut files = lock(&self.0);
        match files.get(path) {
            Some(Some(_)) => drop(files.remove(path)),
            Some(None) => return Err(ErrorKind::IsADirectory.into()),
            None => return Err(ErrorKind::NotFound.into()),
        }
        Ok(())
    }

    fn remove_dir(&self, path: &Path) -> io::Result<()> {
        let mut files = lock(&self.0);
        if files.keys().any(|place| place.parent() == Some(path)) {
            return Err(ErrorKind::DirectoryNotEmpty.into());
        }
        files.remove(path).map(|_| ()).ok_or_else(|| ErrorKind::NotFound.into())
    }

    fn list(&self, path: &Path) -> io::Result<Vec<Entry>> {
        let files = lock(&self.0);
        if !matches!(files.get(path), Some(None)) {
            return Err(ErrorKind::NotFound.into());
        }
        let entry = |(place, node): (&PathBuf, &Option<Arc<MemoryFile>>)| Entry {
            name: place.file_name().unwrap_or_default().to_owned(),
            is_dir: node.is_none(),
            bytes: node.as_ref().map_or(0, |file| lock(&file.0).len() as u64),
            modified: SystemTime::UNIX_EPOCH,
        };
        Ok(files.iter().filter(|(place, _)| place.parent() == Some(path)).map(entry).collect())
    }

    fn sync_dir(&self, _: &Path) -> io::Result<()> {
        Ok(())
    }

    fn touch(&self, _: &Path) -> io::Result<()> {
        Ok(())
    }

    fn lock(&self, _: &Path) -> io::Result<Option<File>> {
        // Nobody else can see this disk.
        File::open("/dev/null").map(Some)
    }

    fn free_bytes(&self, _: &Path) -> io::Result<u64> {
        Ok(1 << 30)
    }

    /// One for all disks of a thread, empty each time.
    fn catalog(&self, path: &Path) -> Result<Arc<dyn Catalog>, CatalogError> {
        thread_local! {
            static CATALOG: (Arc<SqliteCatalog>, tempfile::TempDir) = {
                let memory = tempfile::tempdir_in("/dev/shm").or_else(|_| tempfile::tempdir());
                let folder = memory.expect("a folder");
                let catalog = SqliteCatalog::open(&folder.path().join("catalog.db")).expect("a catalogue");
                (Arc::new(catalog), folder)
            };
        }
        self.put(path, &[]);
        let catalog = CATALOG.with(|(catalog, _)| Arc::clone(catalog));
        for record in catalog.records()? {
            catalog.remove(Key { kind: record.kind, id: &record.id })?;
        }
        Ok(catalog)
    }
}

impl DiskFile for MemoryFile {
    fn write_at(&self, bytes: &[u8], offset: u64) -> io::Result<usize> {
        let mut content = lock(&self.0);
        let start = usize::try_from(offset).map_err(io::Error::other)?;
        let end = start + bytes.len();
        if content.len() < end {
            content.resize(end, 0);
        }
        content[start..end].copy_from_slice(bytes);
        Ok(bytes.len())
    }

    fn read_at(&self, bytes: &mut [u8], offset: u64) -> io::Result<usize> {
        let content = lock(&self.0);
        let start = usize::try_from(offset).unwrap_or(usize::MAX).min(content.len());
        let count = bytes.len().min(content.len() - start);
        bytes[..count].copy_from_slice(&content[start..start + count]);
        Ok(count)
    }

    fn sync_data(&self) -> io::Result<()> {
        Ok(())
    }

    fn set_len(&self, bytes: u64) -> io::Result<()> {
        lock(&self.0).resize(usize::try_from(bytes).map_err(io::Error::other)?, 0);
        Ok(())
    }

    fn length(&self) -> io::Result<u64> {
        Ok(lock(&self.0).len() as u64)
    }
}
