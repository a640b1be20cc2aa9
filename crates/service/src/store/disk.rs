//! The file layer below the store: few operations, so that each of them can be made to fail in a test (`tests/faults/`).

use cager_store::{Catalog, CatalogError, SqliteCatalog};
use std::ffi::OsString;
use std::fmt::Debug;
use std::fs::{self, DirBuilder, File, FileTimes, OpenOptions, TryLockError};
use std::io;
use std::os::unix::fs::{DirBuilderExt, FileExt, MetadataExt, OpenOptionsExt};
use std::path::Path;
use std::sync::Arc;
use std::time::SystemTime;

/// An entry of a folder.
#[derive(Clone, Debug)]
pub struct Entry {
    /// Its name.
    pub name: OsString,
    /// Whether it is a folder; false for a symbolic link to one.
    pub is_dir: bool,
    /// Bytes of a file.
    pub bytes: u64,
    /// Last change, or the last [`Disk::touch`].
    pub modified: SystemTime,
}

/// Folders and files. Every call fails as the system does.
pub trait Disk: Send + Sync + Debug {
    /// Makes a file that is not there yet, for reading and writing.
    ///
    /// # Errors
    /// `AlreadyExists`, or another I/O error.
    fn create_new(&self, path: &Path) -> io::Result<Arc<dyn DiskFile>>;
    /// Opens a file that is there, for reading.
    fn open(&self, path: &Path) -> io::Result<Arc<dyn DiskFile>>;
    /// Opens a file that is there, for reading and writing.
    fn open_for_writing(&self, path: &Path) -> io::Result<Arc<dyn DiskFile>>;
    /// Makes a folder.
    ///
    /// # Errors
    /// `AlreadyExists`, or another I/O error.
    fn create_dir(&self, path: &Path) -> io::Result<()>;
    /// Renames a file, replacing an existing target, or a folder.
    fn rename(&self, from: &Path, to: &Path) -> io::Result<()>;
    /// Removes a file.
    fn remove_file(&self, path: &Path) -> io::Result<()>;
    /// Removes an empty folder.
    fn remove_dir(&self, path: &Path) -> io::Result<()>;
    /// The entries of a folder, in no particular order.
    fn list(&self, path: &Path) -> io::Result<Vec<Entry>>;
    /// Makes the entries of a folder durable (fsync).
    fn sync_dir(&self, path: &Path) -> io::Result<()>;
    /// Sets a file's time of last change to now.
    fn touch(&self, path: &Path) -> io::Result<()>;
    /// Creates and locks a file exclusively, until the handle is dropped; `None` if another process holds the lock.
    fn lock(&self, path: &Path) -> io::Result<Option<File>>;
    /// Bytes that may still be written to the file system of `path`.
    fn free_bytes(&self, path: &Path) -> io::Result<u64>;
    /// Opens the catalogue in this file, which is created if it is missing.
    ///
    /// # Errors
    /// The catalogue's.
    fn catalog(&self, path: &Path) -> Result<Arc<dyn Catalog>, CatalogError>;
    /// Sees that a file, or a folder with all that is in it, can be opened at its path by others than this: where files are in a bucket they are fetched.
    fn bring(&self, _path: &Path) -> io::Result<()> {
        Ok(())
    }
    /// Whether files are kept elsewhere than on this machine, so that reading them all is dear; what they are kept by has checksums of its own.
    fn is_elsewhere(&self) -> bool {
        false
    }
    /// Checks that what has the files besides this machine can be written to.
    fn probe(&self) -> io::Result<()> {
        Ok(())
    }
}

/// An open file with positioned reads and writes, so that readers and a writer can share it. Every call fails as the system does.
pub trait DiskFile: Send + Sync + Debug {
    /// Writes some of `bytes` at `offset`; gives how many.
    fn write_at(&self, bytes: &[u8], offset: u64) -> io::Result<usize>;
    /// Reads some bytes at `offset`; gives how many, 0 at the end of the file.
    fn read_at(&self, bytes: &mut [u8], offset: u64) -> io::Result<usize>;
    /// Makes data and length durable (fdatasync).
    ///
    /// # Errors
    /// I/O errors. Everything written since the last success may be lost, and calling it again would not report that.
    fn sync_data(&self) -> io::Result<()>;
    /// Cuts or extends the file.
    fn set_len(&self, bytes: u64) -> io::Result<()>;
    /// Length in bytes.
    fn length(&self) -> io::Result<u64>;
}

impl dyn DiskFile + '_ {
    /// Writes all of `bytes` at `offset`.
    ///
    /// # Errors
    /// The system's; some bytes may have been written.
    pub fn write_all_at(&self, bytes: &[u8], offset: u64) -> io::Result<()> {
        whole(bytes.len(), io::ErrorKind::WriteZero, |done| self.write_at(&bytes[done..], offset + done as u64))
    }

    /// Fills `bytes` from `offset` on.
    ///
    /// # Errors
    /// `UnexpectedEof` where the file ends before, or another I/O error.
    pub fn read_exact_at(&self, bytes: &mut [u8], offset: u64) -> io::Result<()> {
        let length = bytes.len();
        whole(length, io::ErrorKind::UnexpectedEof, |done| self.read_at(&mut bytes[done..], offset + done as u64))
    }
}

/// Repeats a step, which is told what is done and gives how much more it has done, until all is; `end` is the error where it does nothing.
fn whole(length: usize, end: io::ErrorKind, mut step: impl FnMut(usize) -> io::Result<usize>) -> io::Result<()> {
    let mut done = 0;
    while done < length {
        match step(done) {
            Ok(0) => return Err(end.into()),
            Ok(more) => done += more,
            Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
            Err(error) => return Err(error),
        }
    }
    Ok(())
}

/// The system's own files. What is made here is for the service's user alone, whatever the umask: uploads of all tenants lie here.
#[derive(Clone, Copy, Debug, Default)]
pub struct LocalDisk;

/// Modes of folders and files.
const FOLDER_MODE: u32 = 0o700;
pub(super) const FILE_MODE: u32 = 0o600;

/// Whether users of the machine who share no group with a folder may look into it.
///
/// # Errors
/// The system's.
pub(super) fn is_open_to_all(folder: &Path) -> io::Result<bool> {
    Ok(fs::metadata(folder)?.mode() & 0o007 != 0)
}

impl Disk for LocalDisk {
    fn create_new(&self, path: &Path) -> io::Result<Arc<dyn DiskFile>> {
        Ok(Arc::new(OpenOptions::new().read(true).write(true).create_new(true).mode(FILE_MODE).open(path)?))
    }

    fn open(&self, path: &Path) -> io::Result<Arc<dyn DiskFile>> {
        Ok(Arc::new(File::open(path)?))
    }

    fn open_for_writing(&self, path: &Path) -> io::Result<Arc<dyn DiskFile>> {
        Ok(Arc::new(OpenOptions::new().read(true).write(true).open(path)?))
    }

    fn create_dir(&self, path: &Path) -> io::Result<()> {
        DirBuilder::new().mode(FOLDER_MODE).create(path)
    }

    fn rename(&self, from: &Path, to: &Path) -> io::Result<()> {
        fs::rename(from, to)
    }

    fn remove_file(&self, path: &Path) -> io::Result<()> {
        fs::remove_file(path)
    }

    fn remove_dir(&self, path: &Path) -> io::Result<()> {
        fs::remove_dir(path)
    }

    fn list(&self, path: &Path) -> io::Result<Vec<Entry>> {
        let mut entries = Vec::new();
        for entry in fs::read_dir(path)? {
            let entry = entry?;
            match entry.metadata() {
                Ok(data) => entries.push(Entry {
                    name: entry.file_name(),
                    is_dir: data.is_dir(),
                    bytes: data.len(),
                    modified: data.modified()?,
                }),
                // Removed by another thread since.
                Err(error) if error.kind() == io::ErrorKind::NotFound => {}
                Err(error) => return Err(error),
            }
        }
        Ok(entries)
    }

    fn sync_dir(&self, path: &Path) -> io::Result<()> {
        File::open(path)?.sync_all()
    }

    fn touch(&self, path: &Path) -> io::Result<()> {
        OpenOptions::new().write(true).open(path)?.set_times(FileTimes::new().set_modified(SystemTime::now()))
    }

    fn lock(&self, path: &Path) -> io::Result<Option<File>> {
        let file = OpenOptions::new().read(true).write(true).create(true).truncate(false).mode(FILE_MODE).open(path)?;
        match file.try_lock() {
            Ok(()) => Ok(Some(file)),
            Err(TryLockError::WouldBlock) => Ok(None),
            Err(TryLockError::Error(error)) => Err(error),
        }
    }

    fn free_bytes(&self, path: &Path) -> io::Result<u64> {
        let system = rustix::fs::statvfs(path)?;
        Ok(system.f_bavail.saturating_mul(system.f_frsize))
    }

    fn catalog(&self, path: &Path) -> Result<Arc<dyn Catalog>, CatalogError> {
        Ok(Arc::new(SqliteCatalog::open(path)?))
    }
}

impl DiskFile for File {
    fn write_at(&self, bytes: &[u8], offset: u64) -> io::Result<usize> {
        FileExt::write_at(self, bytes, offset)
    }

    fn read_at(&self, bytes: &mut [u8], offset: u64) -> io::Result<usize> {
        FileExt::read_at(self, bytes, offset)
    }

    fn sync_data(&self) -> io::Result<()> {
        File::sync_data(self)
    }

    fn set_len(&self, bytes: u64) -> io::Result<()> {
        File::set_len(self, bytes)
    }

    fn length(&self) -> io::Result<u64> {
        let metadata = self.metadata()?;
        // A folder can be opened like a file; its length is meaningless.
        if metadata.is_dir() {
            return Err(io::ErrorKind::IsADirectory.into());
        }
        Ok(metadata.len())
    }
}
