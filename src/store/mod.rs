//! What must survive: sessions with their frame logs and containers, uploaded content, prepared solvers. Blocking; callers
//! use their own threads.
//!
//! ```text
//! sessions/<id>/   session.json  frames.log  capture.cager  complete.json  outcome.json
//! cages/<id>/      job.json  rest  frames  cage.obj  outcome.json
//! contents/<key>/  content.json  rest  cage
//! prepared/<key>.solver
//! tmp/             being written; emptied at start       trash/       being removed; emptied at start
//! quarantine/      damaged, with a note; for a person to look at
//! ```
//!
//! Whole files and folders are written in `tmp/`, synced and renamed into place; folders go through `trash/` before they are
//! removed. So what is visible in `sessions`, `cages`, `contents` and `prepared` is whole. The frame log is the one file that
//! grows; [`log`] says how it recovers.

use crate::store::files::Files;
use std::collections::HashSet;
use std::fs::File;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};

mod cage_jobs;
mod content;
pub mod disk;
mod error;
#[cfg(test)]
#[path = "../../tests/faults/mod.rs"]
mod faults;
mod files;
mod found;
pub mod log;
mod meta;
mod names;
mod prepared;
mod sessions;
mod solver_file;
mod spool;

#[cfg(test)]
mod tests;

pub use cage_jobs::{CageJobMeta, StoredPart};
pub use content::{CageFile, Content, MatrixFile};
pub use disk::{Disk, LocalDisk};
pub use error::StoreError;
pub use found::{Kind, Unread};
pub use log::{FrameLog, LogEntry, LogReader, LogRecord};
pub use names::{ContentKey, is_session_id};
pub use sessions::{Completion, Container, Idempotency, SessionMeta};
pub use spool::{Spool, StoredFile};

/// A folder of everything that must survive. Clones share it.
#[derive(Clone, Debug)]
pub struct Store {
    inner: Arc<Inner>,
}

#[derive(Debug)]
struct Inner {
    files: Files,
    /// Held by every open frame log too, so that no other process comes in while one is written.
    lock: Arc<File>,
    /// What is known of logs beside what is in them.
    logs: Arc<Mutex<Logs>>,
    /// Taken around "is it there? then put it there" of shared content.
    publishing: Mutex<()>,
}

#[derive(Debug, Default)]
struct Logs {
    /// Sessions whose log is open: a second writer would overwrite the first.
    open: HashSet<String>,
    /// Sessions whose log the disk may hold damaged, although the system still shows it as it should be.
    doubtful: HashSet<String>,
}

/// A store and what was found in it.
#[derive(Debug)]
pub struct Opened {
    /// The store.
    pub store: Store,
    /// Its sessions, oldest first.
    pub sessions: Vec<SessionMeta>,
    /// Its cage jobs, oldest first.
    pub cage_jobs: Vec<CageJobMeta>,
    /// Sessions and cage jobs that are damaged and were moved out of the way.
    pub quarantined: Vec<Quarantined>,
    /// Sessions and cage jobs that could not be read, and lie where they were.
    pub unread: Vec<Unread>,
}

/// Something damaged.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Quarantined {
    /// Name of the session, or of the file.
    pub name: String,
    /// Where it lies now.
    pub path: PathBuf,
    /// What is wrong with it.
    pub why: String,
}

impl Store {
    /// Opens the folder `root`, made where it is missing, for this process alone. Finishes interrupted deletions, removes
    /// temporaries, and moves sessions with damaged metadata to `quarantine/`. What cannot be read stays where it is.
    ///
    /// # Errors
    /// [`StoreError::Locked`] where another process has it; else what the system says of the folder itself. Damaged sessions
    /// are no error.
    pub fn open(root: &Path, disk: Arc<dyn Disk>) -> Result<Opened, StoreError> {
        make_folder(&*disk, root)?;
        let lock_path = root.join("lock");
        let lock = disk.lock(&lock_path).map_err(|e| StoreError::of(&lock_path, "lock", e))?;
        let lock = lock.ok_or_else(|| StoreError::Locked { path: root.to_owned() })?;
        let files = Files::new(root, disk);
        for folder in [
            files.sessions(),
            files.cages(),
            files.contents(),
            files.prepared(),
            files.quarantine(),
            files.trash(),
            files.tmp(),
        ] {
            make_folder(&*files.disk, &folder)?;
        }
        // What an earlier process did and did not live to sync counts from here on: nobody sees a deleted session any more.
        for folder in [files.trash(), files.sessions(), files.cages(), files.contents(), files.prepared()] {
            files.sync_dir(&folder)?;
        }
        for folder in [files.trash(), files.tmp()] {
            // What cannot be removed is in nobody's way.
            if let Err(error) = files.clear(&folder) {
                tracing::warn!(%error, "something deleted still takes space");
            }
        }
        let found::Found { metas: mut sessions, mut quarantined, mut unread } = found::find::<SessionMeta>(&files)?;
        let found::Found { metas: mut cage_jobs, quarantined: damaged, unread: more } =
            found::find::<CageJobMeta>(&files)?;
        quarantined.extend(damaged);
        unread.extend(more);
        sessions.sort_by(|a, b| (a.created_ms, &a.id).cmp(&(b.created_ms, &b.id)));
        cage_jobs.sort_by(|a, b| (a.created_ms, &a.id).cmp(&(b.created_ms, &b.id)));
        quarantined.sort_by(|a, b| a.name.cmp(&b.name));
        let inner = Inner { files, lock: Arc::new(lock), logs: Arc::default(), publishing: Mutex::new(()) };
        Ok(Opened { store: Self { inner: Arc::new(inner) }, sessions, cage_jobs, quarantined, unread })
    }

    fn files(&self) -> &Files {
        &self.inner.files
    }

    /// Bytes that may still be written; 0 where the system does not say.
    pub fn free_bytes(&self) -> u64 {
        self.files().disk.free_bytes(&self.files().root).unwrap_or(0)
    }

    /// Whether the store can write and sync now.
    ///
    /// # Errors
    /// [`StoreError::Full`], or what the system says.
    pub fn probe(&self) -> Result<(), StoreError> {
        let files = self.files();
        let path = files.temporary("probe");
        let written = files.write_new(&path, b"probe\n");
        files.discard(&path);
        written
    }
}

/// Makes a folder with those above it, durably. Fine where it is there.
fn make_folder(disk: &dyn Disk, path: &Path) -> Result<(), StoreError> {
    let failed = |error| StoreError::of(path, "create the folder", error);
    match disk.create_dir(path) {
        Ok(()) => {}
        Err(error) if error.kind() == io::ErrorKind::AlreadyExists => {
            // A file of that name, or a folder that may not be read, is found here.
            return disk.list(path).map(|_| ()).map_err(failed);
        }
        Err(error) if error.kind() == io::ErrorKind::NotFound => {
            match path.parent().filter(|above| *above != path && *above != Path::new("")) {
                Some(above) => make_folder(disk, above)?,
                None => return Err(failed(error)),
            }
            disk.create_dir(path).map_err(failed)?;
        }
        Err(error) => return Err(failed(error)),
    }
    disk.sync_dir(files::parent(path)).map_err(failed)
}
