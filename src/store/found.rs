//! Sessions and cage jobs as they are found in their folders.

use super::files::Files;
use super::names::check_id;
use super::{Quarantined, Store, StoreError, is_session_id, meta};
use serde::de::DeserializeOwned;
use std::path::PathBuf;

/// What has a folder of its own.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Kind {
    /// A session.
    Session,
    /// A cage job.
    CageJob,
}

impl Kind {
    /// What it is called, in messages and in its metadata.
    pub fn name(self) -> &'static str {
        match self {
            Self::Session => "session",
            Self::CageJob => "cage job",
        }
    }
}

/// Something that could not be read and lies where it was.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Unread {
    /// Session or cage job.
    pub kind: Kind,
    /// Name of its folder.
    pub name: String,
    /// Where it lies.
    pub path: PathBuf,
    /// Why it could not be read.
    pub why: String,
}

/// Metadata in a folder of its own.
pub(crate) trait Stored: DeserializeOwned {
    const KIND: Kind;
    /// Name of the file.
    const FILE: &str;

    /// Its id; also the name of its folder.
    fn id(&self) -> &str;

    /// Where the folders of the kind lie.
    fn all(files: &Files) -> PathBuf;
}

/// What lies in the folders of a kind.
pub(super) struct Found<M> {
    pub(super) metas: Vec<M>,
    pub(super) quarantined: Vec<Quarantined>,
    pub(super) unread: Vec<Unread>,
}

/// Reads all folders of a kind. What is damaged is set aside; what cannot be read, or not be set aside, stays where it is.
pub(super) fn find<M: Stored>(files: &Files) -> Result<Found<M>, StoreError> {
    let all = M::all(files);
    let mut found = Found { metas: Vec::new(), quarantined: Vec::new(), unread: Vec::new() };
    for entry in files.list(&all)? {
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
            Err(error @ StoreError::Damaged { .. }) => files.set_aside(&path, &error.to_string()),
            // It may be readable the next time.
            Err(error) => Err(error),
        };
        match aside {
            Ok(aside) => found.quarantined.push(aside),
            Err(error) => found.unread.push(Unread { kind: M::KIND, name, path, why: error.to_string() }),
        }
    }
    Ok(found)
}

fn read<M: Stored>(files: &Files, id: &str) -> Result<M, StoreError> {
    let (folder, kind) = (M::all(files).join(id), M::KIND.name());
    match meta::read::<M>(files, &folder.join(M::FILE), kind)? {
        Some(meta) if meta.id() == id => Ok(meta),
        Some(meta) => Err(StoreError::damaged(&folder, format!("its metadata is of the {kind} {}", meta.id()))),
        None => Err(StoreError::damaged(&folder, format!("{} is missing", M::FILE))),
    }
}

impl Store {
    /// Reads the metadata of one more session or cage job; None where its folder is gone. Nothing is set aside.
    ///
    /// # Errors
    /// [`StoreError::BadId`], [`StoreError::Damaged`], or what the system says.
    pub(crate) fn find_again<M: Stored>(&self, id: &str) -> Result<Option<M>, StoreError> {
        check_id(id)?;
        match self.files().exists(&M::all(self.files()).join(id))? {
            true => read(self.files(), id).map(Some),
            false => Ok(None),
        }
    }
}
