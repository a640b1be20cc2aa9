//! Scanning the store for sessions and jobs.

use super::files::Files;
use super::names::check_id;
use super::{Quarantined, Store, StoreError, is_session_id, meta};
use serde::de::DeserializeOwned;
use std::path::{Path, PathBuf};

/// Kinds of objects that have a folder of their own.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Kind {
    /// A session.
    Session,
    /// A cage job.
    CageJob,
    /// A recovery.
    Recovery,
    /// A transfer.
    Transfer,
}

impl Kind {
    /// All of them, and what they are called in lists and metrics.
    pub(crate) const ALL: [(Self, &str); 4] = [
        (Self::Session, "sessions"),
        (Self::CageJob, "cages"),
        (Self::Recovery, "recoveries"),
        (Self::Transfer, "transfers"),
    ];

    /// Its name in messages and metadata.
    pub fn name(self) -> &'static str {
        match self {
            Self::Session => "session",
            Self::CageJob => "cage job",
            Self::Recovery => "recovery",
            Self::Transfer => "transfer",
        }
    }

    /// The folder that contains all objects of the kind.
    fn all(self, files: &Files) -> &Path {
        match self {
            Self::Session => &files.sessions,
            Self::CageJob => &files.cages,
            Self::Recovery => &files.recoveries,
            Self::Transfer => &files.transfers,
        }
    }
}

/// A folder that could not be read and was left in place.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Unreadable {
    /// Session or job.
    pub kind: Kind,
    /// Name of its folder.
    pub name: String,
    /// Path of the folder.
    pub path: PathBuf,
    /// Why it could not be read.
    pub why: String,
}

/// Metadata of an object that has a folder of its own.
pub(crate) trait FolderMeta: DeserializeOwned {
    const KIND: Kind;
    /// Name of the metadata file.
    const FILE: &str;

    /// Id; also the name of its folder.
    fn id(&self) -> &str;
}

/// Result of scanning the folders of one kind.
pub(super) struct FolderScan<M> {
    pub(super) metas: Vec<M>,
    pub(super) quarantined: Vec<Quarantined>,
    pub(super) unread: Vec<Unreadable>,
}

/// Reads the metadata of all objects of a kind. Damaged ones are moved to quarantine; unreadable ones stay in place.
pub(super) fn find<M: FolderMeta>(files: &Files) -> Result<FolderScan<M>, StoreError> {
    let all = M::KIND.all(files);
    let mut found = FolderScan { metas: Vec::new(), quarantined: Vec::new(), unread: Vec::new() };
    for entry in files.list(all)? {
        let name = entry.name.to_string_lossy().into_owned();
        let path = all.join(&entry.name);
        let read = if entry.is_dir && is_session_id(&name) {
            read(files, &name)
        } else {
            Err(StoreError::damaged(&path, format!("it is not a {}'s folder", M::KIND.name())))
        };
        let aside = match read {
            Ok(meta) => {
                found.metas.push(meta);
                continue;
            }
            Err(error @ StoreError::Damaged { .. }) => files.move_to_quarantine(&path, &error.to_string()),
            // It may be readable later.
            Err(error) => Err(error),
        };
        match aside {
            Ok(aside) => found.quarantined.push(aside),
            Err(error) => found.unread.push(Unreadable { kind: M::KIND, name, path, why: error.to_string() }),
        }
    }
    Ok(found)
}

fn read<M: FolderMeta>(files: &Files, id: &str) -> Result<M, StoreError> {
    let (folder, kind) = (M::KIND.all(files).join(id), M::KIND.name());
    match meta::read::<M>(files, &folder.join(M::FILE), kind)? {
        Some(meta) if meta.id() == id => Ok(meta),
        Some(meta) => Err(StoreError::damaged(&folder, format!("its metadata belongs to the {kind} {}", meta.id()))),
        None => Err(StoreError::damaged(&folder, format!("{} is missing", M::FILE))),
    }
}

impl Store {
    /// The folder of an object, whether or not it exists.
    pub(super) fn folder(&self, kind: Kind, id: &str) -> Result<PathBuf, StoreError> {
        check_id(id).map(|()| kind.all(self.files()).join(id))
    }

    /// Reads the metadata of one object; `None` if its folder does not exist. Nothing is moved to quarantine.
    ///
    /// # Errors
    /// [`StoreError::Damaged`].
    pub(crate) fn reload_meta<M: FolderMeta>(&self, id: &str) -> Result<Option<M>, StoreError> {
        match self.files().exists(&self.folder(M::KIND, id)?)? {
            true => read(self.files(), id).map(Some),
            false => Ok(None),
        }
    }

    /// Deletes an object, if it exists. On `Ok` the deletion is durable; after an error it is either gone or still there as a whole.
    pub fn delete(&self, kind: Kind, id: &str) -> Result<(), StoreError> {
        self.files().delete_durably(&self.folder(kind, id)?)
    }

    /// Moves a damaged object to `quarantine/`, with a note of what is wrong.
    pub fn quarantine(&self, kind: Kind, id: &str, why: &str) -> Result<(), StoreError> {
        self.files().move_to_quarantine(&self.folder(kind, id)?, why).map(|_| ())
    }

    /// Bytes of an object's files; 0 where there is none.
    pub fn bytes(&self, kind: Kind, id: &str) -> Result<u64, StoreError> {
        self.files().folder_bytes(&self.folder(kind, id)?)
    }
}
