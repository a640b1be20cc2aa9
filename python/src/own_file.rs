//! Files of containers that have no name yet: they go with the last use of them, in the process that made them.

use crate::fault::{Fault, of};
use std::io;
use std::path::Path;
use std::sync::Arc;
use tempfile::{NamedTempFile, TempDir, TempPath};

/// A file that is removed when it is dropped, but not by a forked copy of the process that made it.
pub(crate) struct OwnFile {
    path: TempPath,
    maker: u32,
}

impl OwnFile {
    pub(crate) fn new(path: TempPath) -> Self {
        Self { path, maker: std::process::id() }
    }

    pub(crate) fn path(&self) -> &Path {
        &self.path
    }
}

impl Drop for OwnFile {
    fn drop(&mut self) {
        self.path.disable_cleanup(self.maker != std::process::id());
    }
}

/// An empty file for a container that has no name yet.
pub(crate) fn temporary() -> Result<NamedTempFile, Fault> {
    tempfile::Builder::new().prefix("cager-").suffix(".cager").tempfile().map_err(|error| unwritable(&error))
}

/// A folder that a computation writes into, and whoever waits for it. All that is in it goes when the first of them lets go of it, and when the other does
/// what has been written meanwhile.
#[derive(Clone)]
pub(crate) struct WorkFolder(Arc<TempDir>);

impl WorkFolder {
    pub(crate) fn new() -> Result<Self, Fault> {
        let made = tempfile::Builder::new().prefix("cager-").tempdir();
        Ok(Self(Arc::new(made.map_err(|error| unwritable(&error))?)))
    }

    pub(crate) fn path(&self) -> &Path {
        self.0.path()
    }
}

impl Drop for WorkFolder {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(self.path());
    }
}

fn unwritable(error: &io::Error) -> Fault {
    of("the folder of temporary files", format!("cannot be written to ({error}); set TMPDIR to another"))
}
