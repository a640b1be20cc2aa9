//! Errors of the store, one variant per reaction of the caller.

use cager_store::{BlobsError, CatalogError};
use std::io;
use std::path::{Path, PathBuf};

/// Why something could not be stored or read back.
#[derive(Debug, thiserror::Error)]
pub enum StoreError {
    /// No space left. Nothing was changed; the call can succeed later.
    #[error("there is no space left to write {}; free some, or raise the quota, and try again", path.display())]
    Full {
        /// What was being written.
        path: PathBuf,
    },
    /// Stored data does not match its checksum or its description.
    #[error("{} is damaged: {what}; restore it from a backup, or delete it", path.display())]
    Damaged {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        what: String,
    },
    /// The catalogue is damaged, or gone while files of sessions are there. Without it nobody knows whose they are.
    #[error("{} is damaged: {what}; {}", path.display(), cure_of_catalog(path))]
    CatalogDamaged {
        /// The file, or what the database is called.
        path: PathBuf,
        /// What is wrong.
        what: String,
    },
    /// Another process uses the folder.
    #[error("the data folder {} is in use by another process; stop it, or give another folder", path.display())]
    Locked {
        /// The folder.
        path: PathBuf,
    },
    /// Another process has the database for itself.
    #[error("{what}")]
    InUse {
        /// Which database, who has it and what to do.
        what: String,
    },
    /// The data folder and the database do not belong together.
    #[error("{what}")]
    Elsewhere {
        /// Which, and what to do.
        what: String,
    },
    /// The catalogue or the bucket cannot be used.
    #[error("could not {action} {}: {what}", path.display())]
    Catalog {
        /// The file, or what the database is called.
        path: PathBuf,
        /// What was attempted, as a verb.
        action: &'static str,
        /// What went wrong, and what to do.
        what: String,
    },
    /// The database or the bucket does not answer for now. What was to be written may be there or not; the call can
    /// succeed later.
    #[error("could not {action} {}: {what}", path.display())]
    Away {
        /// The file, or what the database is called.
        path: PathBuf,
        /// What was attempted, as a verb.
        action: &'static str,
        /// What went wrong, and what to do.
        what: String,
    },
    /// Not a valid id; nothing was looked up.
    #[error("{id:?} is not the id of a session: ids are 1 to 64 of the characters 0-9, a-z and -")]
    BadId {
        /// The name, cut after 80 characters.
        id: String,
    },
    /// Another I/O error.
    #[error("could not {action} {}: {cause}; check the disk and the folder's permissions", path.display())]
    Io {
        /// The file or folder.
        path: PathBuf,
        /// What was attempted, as a verb.
        action: &'static str,
        /// The operating system's error.
        cause: io::Error,
    },
}

impl StoreError {
    /// Classifies an I/O error.
    pub(crate) fn of(path: &Path, action: &'static str, cause: io::Error) -> Self {
        use io::ErrorKind::{FileTooLarge, QuotaExceeded, StorageFull};
        // A store error may be wrapped in an I/O error by a writer.
        let cause = match cause.downcast::<Self>() {
            Ok(inner) => return inner,
            Err(cause) => cause,
        };
        match cause.kind() {
            StorageFull | QuotaExceeded | FileTooLarge => Self::Full { path: path.to_owned() },
            _ => {
                let path = path.to_owned();
                match cause.get_ref().map(|inner| (inner, inner.downcast_ref::<CatalogError>())) {
                    Some((inner, Some(CatalogError::Away(_)))) => Self::Away { path, action, what: inner.to_string() },
                    Some((inner, Some(_))) => Self::Catalog { path, action, what: inner.to_string() },
                    Some((inner, None)) => match inner.downcast_ref::<BlobsError>() {
                        Some(error) if error.is_away() => Self::Away { path, action, what: error.to_string() },
                        Some(error) => Self::Catalog { path, action, what: error.to_string() },
                        None => Self::Io { path, action, cause },
                    },
                    None => Self::Io { path, action, cause },
                }
            }
        }
    }

    pub(crate) fn damaged(path: &Path, what: impl Into<String>) -> Self {
        Self::Damaged { path: path.to_owned(), what: what.into() }
    }

    /// Whether the same may succeed later, without a change of what is asked for.
    pub fn is_passing(&self) -> bool {
        matches!(self, Self::Full { .. } | Self::Away { .. })
    }

    /// Whether the file or folder was not there.
    pub fn is_not_found(&self) -> bool {
        matches!(self, Self::Io { cause, .. } if cause.kind() == io::ErrorKind::NotFound)
    }
}

fn cure_of_catalog(path: &Path) -> &'static str {
    match path.file_name().is_some_and(|name| name == super::CATALOG) {
        true => {
            "restore the whole data folder from one backup; without one, copy the finished captures, sessions/*/capture.cager, elsewhere and start with an empty folder"
        }
        false => {
            "restore the database from a backup, and the files of the same moment; without one, copy the finished captures, sessions/*/capture.cager, elsewhere and start with an empty schema and folder"
        }
    }
}

/// Lets a store error pass through the closure that writes a container.
impl From<StoreError> for io::Error {
    fn from(error: StoreError) -> Self {
        Self::other(error)
    }
}
