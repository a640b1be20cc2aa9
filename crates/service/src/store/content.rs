//! Rest poses, cages and regularisation matrices by content key, stored once per tenant: needed to write containers and to prepare again.

use super::{ContentKey, Store, StoreError, meta};
use serde::{Deserialize, Serialize};
use std::fs::File;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::atomic::Ordering::Relaxed;

/// A rest pose as it was uploaded, and its cage, uploaded or made by the service.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Content {
    /// The rest pose.
    pub rest: NamedFile,
    /// The cage.
    pub cage: NamedFile,
    /// The matrix of the regularizer `matrix`.
    pub matrix: Option<NamedFile>,
}

/// A file, uploaded or made by the service.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct NamedFile {
    /// File name; its extension tells the format.
    pub name: String,
    /// Its content.
    pub bytes: Vec<u8>,
}

impl Content {
    /// Bytes of its files.
    pub fn size_bytes(&self) -> u64 {
        [&self.rest, &self.cage].into_iter().chain(&self.matrix).map(|file| file.bytes.len() as u64).sum()
    }
}

#[derive(Debug, Deserialize, Serialize)]
struct Description {
    rest: StoredPart,
    cage: StoredPart,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    matrix: Option<StoredPart>,
}

impl Description {
    fn parts(&self) -> impl Iterator<Item = (&'static str, &StoredPart)> {
        [("rest", Some(&self.rest)), ("cage", Some(&self.cage)), ("matrix", self.matrix.as_ref())]
            .into_iter()
            .filter_map(|(name, part)| Some((name, part?)))
    }
}

/// A file as it was uploaded.
#[derive(Clone, Debug, PartialEq, Eq, Deserialize, Serialize)]
pub struct StoredPart {
    /// File name; its extension tells the format.
    pub name: String,
    /// Its length.
    pub bytes: u64,
    /// Its digest, BLAKE3, hexadecimal.
    pub blake3: String,
}

impl StoredPart {
    /// Describes a file of this name and content.
    pub fn of(name: &str, content: &[u8]) -> Self {
        Self { name: name.into(), bytes: content.len() as u64, blake3: blake3::hash(content).to_hex().to_string() }
    }

    /// Whether a file is a copy of it; reads all of that.
    ///
    /// # Errors
    /// It cannot be read.
    pub fn is_of(&self, path: &Path) -> io::Result<bool> {
        let file = File::open(path)?;
        if file.metadata()?.len() != self.bytes {
            return Ok(false);
        }
        let mut digest = blake3::Hasher::new();
        digest.update_reader(file)?;
        Ok(digest.finalize().to_hex().as_str() == self.blake3)
    }
}

const DESCRIPTION: &str = "content.json";

impl Store {
    pub(super) fn content_path(&self, key: &ContentKey) -> PathBuf {
        self.files().contents.join(key.to_string())
    }

    /// Stores content; durable on `Ok`. Content that exists under the key is kept, unless it is damaged. Callers take turns by key, and with
    /// [`Self::remove_content`].
    pub fn put_content(&self, key: &ContentKey, content: &Content) -> Result<(), StoreError> {
        let files = self.files();
        let place = self.content_path(key);
        let description = Description {
            rest: StoredPart::of(&content.rest.name, &content.rest.bytes),
            cage: StoredPart::of(&content.cage.name, &content.cage.bytes),
            matrix: content.matrix.as_ref().map(|matrix| StoredPart::of(&matrix.name, &matrix.bytes)),
        };
        if self.content_is_there(key, &place)? {
            return Ok(());
        }
        let bytes = meta::wrap(&place.join(DESCRIPTION), "content", &description)?;
        let made = files.publish_folder(&place, |staging| {
            files.write_new(&staging.join("rest"), &content.rest.bytes)?;
            files.write_new(&staging.join("cage"), &content.cage.bytes)?;
            if let Some(matrix) = &content.matrix {
                files.write_new(&staging.join("matrix"), &matrix.bytes)?;
            }
            files.write_new(&staging.join(DESCRIPTION), &bytes)
        });
        match made {
            // Another thread has stored the same.
            Err(StoreError::Io { cause, .. }) if cause.kind() == io::ErrorKind::AlreadyExists => {
                files.sync_dir(&files.contents)
            }
            made => made,
        }
    }

    /// Content by its key; `None` if there is none. Damaged content is moved to quarantine, so that the next upload replaces it.
    ///
    /// # Errors
    /// [`StoreError::Damaged`].
    pub fn content(&self, key: &ContentKey) -> Result<Option<Content>, StoreError> {
        let place = self.content_path(key);
        let found = self.read_content(&place);
        self.quarantine_if_damaged(&place, found)
    }

    /// Only the cage of a content, since a rest pose may be large. Otherwise as [`Self::content`].
    pub fn content_cage(&self, key: &ContentKey) -> Result<Option<NamedFile>, StoreError> {
        let place = self.content_path(key);
        let found = self.describe(&place).and_then(|description| {
            description.map(|Description { cage, .. }| self.read_content_part(&place, "cage", cage)).transpose()
        });
        self.quarantine_if_damaged(&place, found)
    }

    /// What the rest pose, the cage and the matrix of a content are, without reading them; `None` if there is no such content.
    pub fn content_parts(&self, key: &ContentKey) -> Result<Option<[Option<StoredPart>; 3]>, StoreError> {
        let place = self.content_path(key);
        let found = self.describe(&place);
        let described = self.quarantine_if_damaged(&place, found)?;
        Ok(described.map(|Description { rest, cage, matrix }| [Some(rest), Some(cage), matrix]))
    }

    /// Removes content, if it exists. A prepared solver of the key is kept.
    pub fn remove_content(&self, key: &ContentKey) -> Result<(), StoreError> {
        self.files().delete_durably(&self.content_path(key))
    }

    /// The keys of all content.
    pub fn contents(&self) -> Result<Vec<ContentKey>, StoreError> {
        let entries = self.files().list(&self.files().contents)?;
        Ok(entries.iter().filter_map(|entry| entry.name.to_str()?.parse().ok()).collect())
    }

    /// Whether content of no session may be needed: something is in quarantine, or could not be read at the start.
    pub fn keeps_contents(&self) -> Result<bool, StoreError> {
        Ok(self.inner.keeps_contents.load(Relaxed) || !self.files().list(&self.files().quarantine)?.is_empty())
    }

    /// Bytes of a content's files; 0 where there is none.
    pub fn content_bytes(&self, key: &ContentKey) -> Result<u64, StoreError> {
        self.files().folder_bytes(&self.content_path(key))
    }

    /// Checks metadata and file lengths, not every byte, and makes the folder entry durable.
    fn content_is_there(&self, key: &ContentKey, place: &Path) -> Result<bool, StoreError> {
        if !self.files().exists(place)? {
            return Ok(false);
        }
        let looked = self.describe(place).and_then(|description| {
            let Some(description) = description else { return Ok(()) };
            let entries = self.files().list(place)?;
            for (name, part) in description.parts() {
                if !entries.iter().any(|entry| entry.name == name && entry.bytes == part.bytes) {
                    return Err(StoreError::damaged(&place.join(name), "it is missing or of another length"));
                }
            }
            Ok(())
        });
        match self.quarantine_if_damaged(place, looked) {
            Ok(()) => {
                self.files().sync_dir(&self.files().contents)?;
                Ok(true)
            }
            Err(StoreError::Damaged { .. }) => {
                tracing::warn!(%key, "damaged content is replaced by a new upload");
                Ok(false)
            }
            Err(error) => Err(error),
        }
    }

    fn describe(&self, place: &Path) -> Result<Option<Description>, StoreError> {
        let path = place.join(DESCRIPTION);
        match meta::read(self.files(), &path, "content")? {
            None if self.files().exists(place)? => Err(StoreError::damaged(&path, "it is missing")),
            found => Ok(found),
        }
    }

    fn read_content_part(&self, place: &Path, name: &str, part: StoredPart) -> Result<NamedFile, StoreError> {
        let bytes = self.files().read_verified(&place.join(name), part.bytes, &part.blake3)?;
        Ok(NamedFile { name: part.name, bytes })
    }

    pub(super) fn read_content(&self, place: &Path) -> Result<Option<Content>, StoreError> {
        let Some(Description { rest, cage, matrix }) = self.describe(place)? else { return Ok(None) };
        let read = |name: &str, part| self.read_content_part(place, name, part);
        let matrix = matrix.map(|part| read("matrix", part)).transpose()?;
        Ok(Some(Content { rest: read("rest", rest)?, cage: read("cage", cage)?, matrix }))
    }
}
