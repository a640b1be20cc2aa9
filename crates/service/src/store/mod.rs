//! Persistent data: sessions with their frames and containers, uploaded content, jobs and prepared solvers. All calls block.
//! Calls with an id that is not valid fail with [`StoreError::BadId`], calls that write may fail with [`StoreError::Full`], and any call may
//! fail as the disk does, with [`StoreError::Io`]; the documentation of each names only further errors.
//!
//! ```text
//! catalog.bucket   the bucket where the files are in one, and the folder is a cache of it
//! lock             locked while a process uses the folder
//! catalog.db       records of sessions and jobs, and the cages of frames (crate `cager-store`), with -wal, -shm and .reserve beside it
//! catalog.database instead of it where they are in a database: the folder's number, which that has too
//! sessions/<id>/   capture.cager  frames-<first>  group-<first>  last-<first>
//! cages/<id>/      rest  frames  cage.obj
//! recoveries/<id>/ template  cage  rig  manifold  frame-<k>  capture.cager  cages  report.json  joints.csv  joints.bvh
//! transfers/<id>/  target  source  source_rest  source_frames  cage  capture.cager  report.json
//! contents/<key>/  content.json  rest  cage  matrix
//! prepared/<key>.solver
//! tmp/             being written; emptied at start       trash/       being removed; emptied at start
//! quarantine/      damaged, with a note; for a person to look at
//! ```
//!
//! Files and folders are written in `tmp/`, synced and renamed into place; folders are moved to `trash/` before they are removed. So
//! everything in `sessions`, `cages`, `recoveries`, `transfers`, `contents` and `prepared` is complete, but for frames that wait to be coded,
//! whose digests the catalogue has. A record is there before its folder and after it: what it says of its phase decides.

use crate::store::bucket::Bucket;
use crate::store::fenced::FencedDisk;
use crate::store::files::Files;
use crate::sync::lock as lock_of;
use cager_store::{Catalog, CatalogError, Record};
use std::collections::HashMap;
use std::fs::File;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;
use std::sync::{Arc, Mutex};

mod bucket;
mod cage_jobs;
mod content;
mod database;
pub mod disk;
mod error;
mod evicted;
#[cfg(test)]
#[path = "../../../../tests/faults/mod.rs"]
mod faults;
mod fenced;
mod files;
mod frames;
mod groups;
mod jobs;
mod meta;
mod mirrored;
mod names;
mod prepared;
mod records;
mod recoveries;
mod sessions;
mod solver_file;
mod spool;
mod transfers;
mod verified;
mod workshop;

#[cfg(test)]
mod tests;

pub use cage_jobs::{CAGE, CageJobMeta};
pub use cager_store::{CagePlace, FrameEntry, Kind, NewFrame, PostgresCatalog};
pub use content::{Content, NamedFile, StoredPart};
pub use disk::{Disk, LocalDisk};
pub use error::StoreError;
pub(crate) use jobs::JobMeta;
pub use names::{ContentKey, is_session_id};
pub(crate) use records::RecordMeta;
pub use recoveries::{RecoveryMeta, RecoveryParts};
pub use sessions::{Completion, Container, Idempotency, SessionBytes, SessionMeta};
pub use spool::{Spool, StoredFile};
pub use transfers::{PAIRS, SOURCE, SOURCE_FRAMES, TransferMeta};
pub use verified::Verified;
pub use workshop::Workshop;

/// The data folder. Clones share it.
#[derive(Clone, Debug)]
pub struct Store {
    inner: Arc<Inner>,
}

#[derive(Debug)]
struct Inner {
    files: Files,
    catalog: Arc<dyn Catalog>,
    /// Its file, or what the database is called.
    catalog_path: PathBuf,
    is_in_database: bool,
    /// Something that may need content could not be read at the start.
    keeps_contents: AtomicBool,
    /// Records as they were read at the start, so that each is read once.
    at_start: Mutex<HashMap<(Kind, String), Record>>,
    /// `None` where the database has the lock.
    _lock: Option<File>,
}

/// A part of what has the data.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Part {
    /// The data folder, and what is known of sessions where that is in it.
    #[default]
    Folder,
    /// The bucket with the files.
    Bucket,
    /// The database.
    Database,
}

impl Part {
    /// What it is called in messages.
    pub fn name(self) -> &'static str {
        match self {
            Self::Folder => "the data folder",
            Self::Bucket => "the bucket",
            Self::Database => "the database",
        }
    }
}

/// What of a store is not in its folder: one machine's is all there.
#[derive(Clone, Copy, Debug, Default)]
pub struct Shared<'a> {
    /// Address of the database with its catalogue.
    pub catalog: Option<&'a str>,
    /// Address of the bucket with its files, where its catalogue is in a database.
    pub blobs: Option<&'a str>,
    /// Bytes of the bucket's files that may be in the folder too.
    pub kept_bytes: u64,
}

/// Name of the catalogue's file.
const CATALOG: &str = "catalog.db";

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
    /// What is damaged and left out: files were moved to quarantine, records stay where they are.
    pub quarantined: Vec<Quarantined>,
}

/// A damaged object in quarantine.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Quarantined {
    /// Name of the session, or of the file.
    pub name: String,
    /// Where it is now.
    pub path: PathBuf,
    /// What is wrong with it.
    pub why: String,
}

impl Store {
    /// Whether a service has its data in this folder. Changes nothing.
    pub fn is_in(root: &Path) -> bool {
        [CATALOG, database::NUMBER, bucket::MARKER].into_iter().any(|name| root.join(name).exists())
    }

    /// Opens the folder `root` for this process alone, creating it if it is missing, with what is elsewhere where that is given. Finishes interrupted deletions, removes temporary
    /// files, and moves objects with damaged metadata to `quarantine/`.
    ///
    /// # Errors
    /// [`StoreError::Locked`] or [`StoreError::InUse`] if another process uses it; [`StoreError::Elsewhere`] where database and folder do not belong
    /// together; [`StoreError::CatalogDamaged`] where its catalogue is damaged, or is missing while sessions or
    /// jobs are there. Damaged sessions are not an error.
    pub fn open(root: &Path, disk: Arc<dyn Disk>, shared: Shared<'_>) -> Result<Opened, StoreError> {
        make_folder(&*disk, root)?;
        let lock_path = root.join("lock");
        let lock = || {
            let lock = disk.lock(&lock_path).map_err(|e| StoreError::of(&lock_path, "lock", e))?;
            lock.ok_or_else(|| StoreError::Locked { path: root.to_owned() })
        };
        // Where machines share the folder, a lock of one that is gone may stay for long; the database knows better once it has all.
        let is_own = shared.catalog.is_none() || root.join(CATALOG).exists();
        let lock = is_own.then(lock).transpose()?;
        let (files, in_database) = open_folder(root, disk, shared)?;
        let own = [&files.sessions, &files.cages, &files.recoveries, &files.transfers, &files.contents];
        let kept = [&files.trash, &files.prepared].into_iter().chain(own);
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
        let (catalog, catalog_path) = match in_database {
            Some(opened) => opened,
            None => own_catalog(&files)?,
        };
        let keeps_contents = AtomicBool::new(false);
        let store = Self {
            inner: Arc::new(Inner {
                files,
                catalog,
                catalog_path,
                is_in_database: shared.catalog.is_some(),
                keeps_contents,
                at_start: Mutex::default(),
                _lock: lock,
            }),
        };
        let records = store.catalog().records().map_err(|e| store.failed("open", e))?;
        if records.is_empty() && records::has_objects(store.files())? {
            let what = "it is empty, and there are sessions or jobs in the folder".to_owned();
            return Err(StoreError::CatalogDamaged { path: store.catalog_path().to_owned(), what });
        }
        let mut quarantined = Vec::new();
        store.match_folders(&records, &mut quarantined)?;
        let records = store.tidy_records(records);
        let sessions = store.metas(&records, &mut quarantined);
        let cage_jobs = store.metas(&records, &mut quarantined);
        let recoveries = store.metas(&records, &mut quarantined);
        let transfers = store.metas(&records, &mut quarantined);
        let known = records.into_iter().map(|record| ((record.kind, record.id.clone()), record));
        *lock_of(&store.inner.at_start) = known.collect();
        quarantined.sort_by(|a, b| a.name.cmp(&b.name));
        Ok(Opened { store, sessions, cage_jobs, recoveries, transfers, quarantined })
    }

    fn catalog(&self) -> &dyn Catalog {
        &*self.inner.catalog
    }

    fn catalog_path(&self) -> &Path {
        &self.inner.catalog_path
    }

    /// An error of the catalogue.
    fn failed(&self, action: &'static str, error: CatalogError) -> StoreError {
        of_catalog(self.catalog_path(), action, error)
    }

    fn files(&self) -> &Files {
        &self.inner.files
    }

    /// What was read at the start is read anew from here on.
    pub fn has_started(&self) {
        *lock_of(&self.inner.at_start) = HashMap::new();
    }

    /// Lets another process take the database over: this one changes nothing afterwards.
    pub fn release(&self) {
        self.catalog().release();
    }

    /// Whether another process has taken the database over, so that this one can change nothing any more.
    pub fn is_taken_over(&self) -> bool {
        self.catalog().is_taken_over()
    }

    /// Free space of the file system, in bytes; 0 if unknown.
    pub fn free_bytes(&self) -> u64 {
        self.files().disk.free_bytes(&self.files().root).unwrap_or(0)
    }

    /// Opens a file of the store for reading.
    pub fn open_file(&self, path: &Path) -> Result<File, StoreError> {
        self.bring(path)?;
        let file = File::open(path).map_err(|e| StoreError::of(path, "open", e))?;
        // A folder opens like a file, and cannot be read.
        match file.metadata() {
            Ok(metadata) if metadata.is_dir() => Err(StoreError::of(path, "open", io::ErrorKind::IsADirectory.into())),
            Ok(_) => Ok(file),
            Err(e) => Err(StoreError::of(path, "open", e)),
        }
    }

    /// Sees that a file of the store can be opened at its path.
    pub fn bring(&self, path: &Path) -> Result<(), StoreError> {
        self.files().disk.bring(path).map_err(|e| StoreError::of(path, "open", e))
    }

    /// Checks that the store can write and sync, files and records. `part` says what is being tried, and at the end what was tried last.
    pub fn probe(&self, part: &Mutex<Part>) -> Result<(), StoreError> {
        let files = self.files();
        let tries = |tried| *lock_of(part) = tried;
        let records = if self.inner.is_in_database { Part::Database } else { Part::Folder };
        tries(Part::Folder);
        let path = files.temporary("probe");
        let written = files.write_new(&path, b"probe\n");
        // Before a file is removed, the database is asked whose it is.
        tries(records);
        files.discard(&path);
        tries(Part::Folder);
        written?;
        if files.disk.is_elsewhere() {
            tries(Part::Bucket);
        }
        files.disk.probe().map_err(|e| StoreError::of(&files.root, "write", e))?;
        tries(records);
        self.catalog().probe().map_err(|e| self.failed("write", e))
    }
}

/// A catalogue, and its file or what the database is called.
type Named = (Arc<dyn Catalog>, PathBuf);

/// Makes the folders in `root`, and opens the catalogue where it is in a database: before anything is removed, since it is another process's folder
/// where the database is.
fn open_folder(root: &Path, disk: Arc<dyn Disk>, shared: Shared<'_>) -> Result<(Files, Option<Named>), StoreError> {
    let files = Files::new(root, disk);
    if shared.blobs.is_none() {
        bucket::refuse(&files)?;
    }
    if shared.catalog.is_none() {
        database::refuse(&files)?;
    }
    let parts = [&files.sessions, &files.cages, &files.recoveries, &files.transfers, &files.contents];
    for folder in parts.into_iter().chain([&files.trash, &files.prepared, &files.quarantine, &files.tmp]) {
        make_folder(&*files.disk, folder)?;
    }
    let Some(url) = shared.catalog else { return Ok((files, None)) };
    let database = database::open(url)?;
    // What is only here is sent nowhere before it is known to belong to the database.
    if shared.blobs.is_some() && bucket::is_own(&files)? {
        database.check_folder(&files)?;
    }
    let bucket = shared.blobs.map(|url| bucket::open(&files, url, database.taken, shared.kept_bytes)).transpose()?;
    let (catalog, name) = database.of_folder(bucket.as_ref().map_or(&files, |bucket| &bucket.files))?;
    let files = bucket.map_or(Ok(files), Bucket::completed)?;
    let disk =
        Arc::new(FencedDisk { disk: files.disk, catalog: Arc::clone(&catalog), temporary: files.tmp.clone().into() });
    Ok((Files::new(root, disk), Some((catalog, name))))
}

/// Opens the catalogue in the folder itself. Gives its path too.
fn own_catalog(files: &Files) -> Result<Named, StoreError> {
    let path = files.root.join(CATALOG);
    if !files.exists(&path)? && records::has_objects(files)? {
        let what = "it is missing, and there are sessions or jobs in the folder".to_owned();
        return Err(StoreError::CatalogDamaged { path, what });
    }
    let catalog = files.disk.catalog(&path).map_err(|e| of_catalog(&path, "open", e))?;
    files.sync_dir(&files.root)?;
    Ok((catalog, path))
}

fn of_catalog(path: &Path, action: &'static str, error: CatalogError) -> StoreError {
    let cause: io::Error = match error {
        CatalogError::Full => return StoreError::Full { path: path.to_owned() },
        CatalogError::Damaged(what) => return StoreError::damaged(path, what),
        CatalogError::Gone => io::ErrorKind::NotFound.into(),
        CatalogError::Taken => io::ErrorKind::AlreadyExists.into(),
        // While the service runs that is no damage of the session that met it.
        CatalogError::Corrupt(what) if action == "open" => {
            return StoreError::CatalogDamaged { path: path.to_owned(), what };
        }
        newer @ CatalogError::Newer { .. } => {
            return StoreError::Elsewhere { what: format!("{} cannot be used: {newer}", path.display()) };
        }
        other => {
            // A database names itself.
            let (what, name) = (other.to_string(), path.display().to_string());
            let what = what.strip_prefix(&name).map_or(&what[..], str::trim_start).to_owned();
            let path = path.to_owned();
            return match other {
                CatalogError::Away(_) => StoreError::Away { path, action, what },
                _ => StoreError::Catalog { path, action, what },
            };
        }
    };
    StoreError::of(path, action, cause)
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
