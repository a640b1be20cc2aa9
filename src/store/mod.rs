//! Persistent data: sessions with their frame logs and containers, uploaded content, cage jobs and prepared solvers. All calls block.
//! Calls with an id that is not valid fail with [`StoreError::BadId`], calls that write may fail with [`StoreError::Full`], and any call may
//! fail as the disk does, with [`StoreError::Io`]; the documentation of each names only further errors.
//!
//! ```text
//! lock             locked while a process uses the folder
//! sessions/<id>/   session.json  frames.log  capture.cager  complete.json  outcome.json  announce.json
//!                  frames-<first>  group-<first>  last-<first>
//! cages/<id>/      job.json  rest  frames  attempts.json  cage.obj  outcome.json
//! recoveries/<id>/ recovery.json  template  cage  rig  manifold  frame-<k>  attempts.json  complete.json
//!                  capture.cager  cages  report.json  joints.csv  joints.bvh  outcome.json
//! transfers/<id>/  transfer.json  target  source  source_rest  source_frames  cage  attempts.json
//!                  capture.cager  report.json  outcome.json
//! contents/<key>/  content.json  rest  cage  matrix
//! prepared/<key>.solver
//! tmp/             being written; emptied at start       trash/       being removed; emptied at start
//! quarantine/      damaged, with a note; for a person to look at
//! ```
//!
//! Files and folders are written in `tmp/`, synced and renamed into place; folders are moved to `trash/` before they are removed. So
//! everything in `sessions`, `cages`, `recoveries`, `transfers`, `contents` and `prepared` is complete. Only the frame log grows in place, whose recovery [`log`]
//! describes, and frames that wait to be coded, whose digests it has.

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
mod groups;
mod jobs;
pub mod log;
mod meta;
mod names;
mod prepared;
mod recoveries;
mod scan;
mod sessions;
mod solver_file;
mod spool;
mod transfers;
mod workshop;

#[cfg(test)]
mod tests;

pub use cage_jobs::CageJobMeta;
pub use content::{Content, NamedFile, StoredPart};
pub use disk::{Disk, LocalDisk};
pub use error::StoreError;
pub(crate) use jobs::JobMeta;
pub use log::{FrameLog, LogEntry, LogReader, LogRecord};
pub use names::{ContentKey, is_session_id};
pub use recoveries::{RecoveryMeta, RecoveryParts};
pub(crate) use scan::FolderMeta;
pub use scan::{Kind, Unreadable};
pub use sessions::{Completion, Container, Idempotency, SessionBytes, SessionMeta};
pub use spool::{Spool, StoredFile};
pub use transfers::{PAIRS, SOURCE, SOURCE_FRAMES, TransferMeta};
pub use workshop::Workshop;

/// The data folder. Clones share it.
#[derive(Clone, Debug)]
pub struct Store {
    inner: Arc<Inner>,
}

#[derive(Debug)]
struct Inner {
    files: Files,
    /// Shared with every open frame log, so that the folder stays locked while one is written.
    lock: Arc<File>,
    /// Which logs are open, and which need rewriting.
    logs: Arc<Mutex<LogRegistry>>,
}

#[derive(Debug, Default)]
struct LogRegistry {
    /// Sessions whose log is open; a second writer is refused.
    open: HashSet<String>,
    /// Sessions whose log may have lost data in a failed sync.
    needs_rewrite: HashSet<String>,
}

/// An opened store and its contents.
#[derive(Debug)]
pub struct Opened {
    /// The store.
    pub store: Store,
    /// Its sessions, oldest first.
    pub sessions: Vec<SessionMeta>,
    /// Its cage jobs, oldest first.
    pub cage_jobs: Vec<CageJobMeta>,
    /// Its recoveries, oldest first.
    pub recoveries: Vec<RecoveryMeta>,
    /// Its transfers, oldest first.
    pub transfers: Vec<TransferMeta>,
    /// Sessions and jobs that were damaged and moved to quarantine.
    pub quarantined: Vec<Quarantined>,
    /// Sessions and jobs that could not be read and were left in place.
    pub unread: Vec<Unreadable>,
}

/// A damaged object in quarantine.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Quarantined {
    /// Name of the session, or of the file.
    pub name: String,
    /// Path in quarantine.
    pub path: PathBuf,
    /// What is wrong with it.
    pub why: String,
}

impl Store {
    /// Opens the folder `root` for this process alone, creating it if it is missing. Finishes interrupted deletions, removes temporary
    /// files, and moves objects with damaged metadata to `quarantine/`. Unreadable ones stay in place.
    ///
    /// # Errors
    /// [`StoreError::Locked`] if another process uses it, or I/O errors of the folder itself. Damaged sessions are not an error.
    pub fn open(root: &Path, disk: Arc<dyn Disk>) -> Result<Opened, StoreError> {
        make_folder(&*disk, root)?;
        let lock_path = root.join("lock");
        let lock = disk.lock(&lock_path).map_err(|e| StoreError::of(&lock_path, "lock", e))?;
        let lock = lock.ok_or_else(|| StoreError::Locked { path: root.to_owned() })?;
        let files = Files::new(root, disk);
        let own = [&files.sessions, &files.cages, &files.recoveries, &files.transfers, &files.contents];
        let kept = [&files.trash, &files.prepared].into_iter().chain(own);
        for folder in kept.clone().chain([&files.quarantine, &files.tmp]) {
            make_folder(&*files.disk, folder)?;
        }
        // They may be so on purpose: whoever made them decides.
        let is_open = |folder: &Path| disk::is_open_to_all(folder).unwrap_or(false);
        if is_open(root) && own.into_iter().any(|folder| is_open(folder)) {
            let folder = root.display();
            tracing::warn!(
                "every user of this machine may look into the data folder {folder}; close it: chmod -R o= {folder}"
            );
        }
        // Renames that an earlier process did not live to sync are made durable before they are relied on.
        for folder in kept {
            files.sync_dir(folder)?;
        }
        for folder in [&files.trash, &files.tmp] {
            // Leftovers do no harm.
            if let Err(error) = files.clear(folder) {
                tracing::warn!(%error, "something deleted still takes space");
            }
        }
        let scan::FolderScan { metas: mut sessions, mut quarantined, mut unread } = scan::find::<SessionMeta>(&files)?;
        sessions.sort_by(|a, b| (a.created_ms, &a.id).cmp(&(b.created_ms, &b.id)));
        let cage_jobs = jobs::find(&files, &mut quarantined, &mut unread)?;
        let recoveries = jobs::find(&files, &mut quarantined, &mut unread)?;
        let transfers = jobs::find(&files, &mut quarantined, &mut unread)?;
        quarantined.sort_by(|a, b| a.name.cmp(&b.name));
        let inner = Inner { files, lock: Arc::new(lock), logs: Arc::default() };
        let store = Self { inner: Arc::new(inner) };
        Ok(Opened { store, sessions, cage_jobs, recoveries, transfers, quarantined, unread })
    }

    fn files(&self) -> &Files {
        &self.inner.files
    }

    /// Free space of the file system, in bytes; 0 if unknown.
    pub fn free_bytes(&self) -> u64 {
        self.files().disk.free_bytes(&self.files().root).unwrap_or(0)
    }

    /// Checks that the store can write and sync.
    pub fn probe(&self) -> Result<(), StoreError> {
        let files = self.files();
        let path = files.temporary("probe");
        let written = files.write_new(&path, b"probe\n");
        files.discard(&path);
        written
    }
}

/// Creates a folder and its parents, durably, unless it exists.
fn make_folder(disk: &dyn Disk, path: &Path) -> Result<(), StoreError> {
    let failed = |error| StoreError::of(path, "create the folder", error);
    match disk.create_dir(path) {
        Ok(()) => {}
        Err(error) if error.kind() == io::ErrorKind::AlreadyExists => {
            // Reports a file of that name, or a folder that cannot be read.
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
