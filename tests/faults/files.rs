//! The operations of a faulty disk: admitted or not, done, noted in the shadow.

use super::super::disk::{Disk, DiskFile, Entry, LocalDisk};
use super::shadow::Shadow;
use super::{FaultyDisk, Op, State, Verdict, stopped};
use cager_store::{Catalog, CatalogError};
use std::fs::File;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::{Arc, MutexGuard};

impl Disk for FaultyDisk {
    fn create_new(&self, path: &Path) -> io::Result<Arc<dyn DiskFile>> {
        let (inner, node) = self.run(Op::Create, path, |shadow| {
            let inner = LocalDisk.create_new(path)?;
            Ok((inner, shadow.create(path, false)))
        })?;
        Ok(self.file(path, inner, node))
    }

    fn open(&self, path: &Path) -> io::Result<Arc<dyn DiskFile>> {
        let (inner, node) = self.run(Op::Open, path, |shadow| Ok((LocalDisk.open(path)?, shadow.find(path))))?;
        Ok(self.file(path, inner, node))
    }

    fn open_for_writing(&self, path: &Path) -> io::Result<Arc<dyn DiskFile>> {
        let open = |shadow: &mut Shadow| Ok((LocalDisk.open_for_writing(path)?, shadow.find(path)));
        let (inner, node) = self.run(Op::Open, path, open)?;
        Ok(self.file(path, inner, node))
    }

    fn create_dir(&self, path: &Path) -> io::Result<()> {
        self.run(Op::CreateDir, path, |shadow| {
            LocalDisk.create_dir(path)?;
            shadow.create(path, true);
            Ok(())
        })
    }

    fn rename(&self, from: &Path, to: &Path) -> io::Result<()> {
        self.run(Op::Rename, to, |shadow| {
            LocalDisk.rename(from, to)?;
            shadow.rename(from, to);
            Ok(())
        })
    }

    fn remove_file(&self, path: &Path) -> io::Result<()> {
        self.run(Op::Remove, path, |shadow| {
            LocalDisk.remove_file(path)?;
            shadow.remove(path);
            Ok(())
        })
    }

    fn remove_dir(&self, path: &Path) -> io::Result<()> {
        self.run(Op::Remove, path, |shadow| {
            LocalDisk.remove_dir(path)?;
            shadow.remove(path);
            Ok(())
        })
    }

    fn list(&self, path: &Path) -> io::Result<Vec<Entry>> {
        self.run(Op::List, path, |_| LocalDisk.list(path))
    }

    fn sync_dir(&self, path: &Path) -> io::Result<()> {
        self.run(Op::SyncDir, path, |shadow| {
            LocalDisk.list(path)?;
            shadow.sync_dir(path);
            Ok(())
        })
    }

    fn touch(&self, path: &Path) -> io::Result<()> {
        self.run(Op::Touch, path, |_| LocalDisk.touch(path))
    }

    fn lock(&self, path: &Path) -> io::Result<Option<File>> {
        LocalDisk.lock(path)
    }

    fn free_bytes(&self, path: &Path) -> io::Result<u64> {
        let told = self.state().free_bytes;
        told.map_or_else(|| LocalDisk.free_bytes(path), Ok)
    }

    /// What is in the folder only says that there is one.
    fn catalog(&self, path: &Path) -> Result<Arc<dyn Catalog>, CatalogError> {
        let failed = |error: io::Error| match error.kind() {
            io::ErrorKind::StorageFull => CatalogError::Full,
            _ => CatalogError::Failed(error.to_string()),
        };
        match self.open(path) {
            Err(error) if error.kind() == io::ErrorKind::NotFound => drop(self.create_new(path).map_err(failed)?),
            opened => drop(opened.map_err(failed)?),
        }
        super::catalog::open(self, path)
    }
}

#[derive(Debug)]
pub(super) struct FaultyFile {
    pub(super) disk: FaultyDisk,
    pub(super) path: PathBuf,
    pub(super) inner: Arc<dyn DiskFile>,
    pub(super) node: Option<usize>,
    pub(super) generation: u64,
}

impl FaultyFile {
    fn admit(&self, op: Op) -> (MutexGuard<'_, State>, Verdict) {
        let mut state = self.disk.state();
        let verdict = if state.generation == self.generation {
            state.admit(op, &self.path)
        } else {
            Verdict::Error(io::Error::other("the file was opened before the restart"))
        };
        (state, verdict)
    }

    fn run<T>(&self, op: Op, act: impl FnOnce(&mut Shadow) -> io::Result<T>) -> io::Result<T> {
        let (mut state, verdict) = self.admit(op);
        match verdict {
            Verdict::Whole | Verdict::Half => act(&mut state.shadow),
            Verdict::HalfAndStop => Err(stopped()),
            Verdict::Error(error) | Verdict::Ruin(error) => Err(error),
        }
    }
}

impl DiskFile for FaultyFile {
    fn write_at(&self, bytes: &[u8], offset: u64) -> io::Result<usize> {
        let (mut state, verdict) = self.admit(Op::Write);
        let half = &bytes[..bytes.len().div_ceil(2)];
        let (some, result) = match verdict {
            Verdict::Whole => (bytes, Ok(bytes.len())),
            Verdict::Half => (half, Ok(half.len())),
            Verdict::HalfAndStop => (half, Err(stopped())),
            Verdict::Error(error) | Verdict::Ruin(error) => return Err(error),
        };
        self.inner.write_all_at(some, offset)?;
        state.shadow.write(self.node, offset, some);
        result
    }

    fn read_at(&self, bytes: &mut [u8], offset: u64) -> io::Result<usize> {
        self.run(Op::Read, |_| self.inner.read_at(bytes, offset))
    }

    /// Never reaches the real disk: what is durable is what the shadow says.
    fn sync_data(&self) -> io::Result<()> {
        let (mut state, verdict) = self.admit(Op::Sync);
        match verdict {
            Verdict::Whole | Verdict::Half => {
                state.shadow.sync(self.node);
                Ok(())
            }
            Verdict::HalfAndStop => Err(stopped()),
            Verdict::Error(error) => {
                state.shadow.lose(self.node, false);
                Err(error)
            }
            Verdict::Ruin(error) => {
                state.shadow.lose(self.node, true);
                Err(error)
            }
        }
    }

    fn set_len(&self, bytes: u64) -> io::Result<()> {
        self.run(Op::Truncate, |shadow| {
            self.inner.set_len(bytes)?;
            shadow.set_len(self.node, bytes);
            Ok(())
        })
    }

    fn length(&self) -> io::Result<u64> {
        self.run(Op::Read, |_| self.inner.length())
    }
}
