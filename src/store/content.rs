//! Rest poses, cages and regularisation matrices by content key, stored once per tenant: needed to write containers and to prepare again.

use super::{ContentKey, Store, StoreError, meta};
use serde::{Deserialize, Serialize};
use std::path::Path;

/// A rest pose as it was uploaded, and its cage, uploaded or made by the service.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Content {
    /// File name of the rest pose; its extension tells the format.
    pub rest_name: String,
    /// The file.
    pub rest: Vec<u8>,
    /// File name of the cage.
    pub cage_name: String,
    /// The file.
    pub cage: Vec<u8>,
    /// The matrix of the regularizer `matrix`.
    pub matrix: Option<MatrixFile>,
}

/// A cage file, uploaded or made by the service.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CageFile {
    /// File name; its extension tells the format.
    pub name: String,
    /// The file.
    pub bytes: Vec<u8>,
}

/// A matrix as it was uploaded.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct MatrixFile {
    /// File name, for messages.
    pub name: String,
    /// The file.
    pub bytes: Vec<u8>,
}

impl Content {
    /// Bytes of its files.
    pub fn size_bytes(&self) -> u64 {
        (self.rest.len() + self.cage.len() + self.matrix.as_ref().map_or(0, |matrix| matrix.bytes.len())) as u64
    }
}

#[derive(Debug, Deserialize, Serialize)]
struct Description {
    rest: Part,
    cage: Part,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    matrix: Option<Part>,
}

impl Description {
    fn parts(&self) -> impl Iterator<Item = (&'static str, &Part)> {
        [("rest", Some(&self.rest)), ("cage", Some(&self.cage)), ("matrix", self.matrix.as_ref())]
            .into_iter()
            .filter_map(|(name, part)| Some((name, part?)))
    }
}

#[derive(Debug, Deserialize, Serialize)]
struct Part {
    name: String,
    bytes: u64,
    blake3: String,
}

impl Part {
    fn of(name: &str, content: &[u8]) -> Self {
        Self { name: name.into(), bytes: content.len() as u64, blake3: blake3::hash(content).to_hex().to_string() }
    }
}

const DESCRIPTION: &str = "content.json";

impl Store {
    /// Stores content; durable on `Ok`. Content that exists under the key is kept, unless it is damaged.
    ///
    /// # Errors
    /// [`StoreError::Full`], or another I/O error.
    pub fn put_content(&self, key: &ContentKey, content: &Content) -> Result<(), StoreError> {
        let files = self.files();
        let place = files.contents().join(key.to_string());
        let description = Description {
            rest: Part::of(&content.rest_name, &content.rest),
            cage: Part::of(&content.cage_name, &content.cage),
            matrix: content.matrix.as_ref().map(|matrix| Part::of(&matrix.name, &matrix.bytes)),
        };
        if self.content_is_there(key, &place)? {
            return Ok(());
        }
        let bytes = meta::wrap(&place.join(DESCRIPTION), "content", &description)?;
        let staging = files.temporary("content");
        let make = || {
            files.disk.create_dir(&staging).map_err(|e| StoreError::of(&staging, "create", e))?;
            files.write_new(&staging.join("rest"), &content.rest)?;
            files.write_new(&staging.join("cage"), &content.cage)?;
            if let Some(matrix) = &content.matrix {
                files.write_new(&staging.join("matrix"), &matrix.bytes)?;
            }
            files.write_new(&staging.join(DESCRIPTION), &bytes)?;
            files.sync_dir(&staging)?;
            let _one_at_a_time = self.publishing();
            if files.exists(&place)? {
                files.discard(&staging);
                return Ok(());
            }
            files.publish(&staging, &place)
        };
        make().inspect_err(|_| files.discard(&staging))
    }

    /// Content by its key; `None` if there is none. Damaged content is moved to quarantine, so that the next upload replaces it.
    ///
    /// # Errors
    /// [`StoreError::Damaged`], or another I/O error.
    pub fn content(&self, key: &ContentKey) -> Result<Option<Content>, StoreError> {
        let place = self.files().contents().join(key.to_string());
        let found = self.read_content(&place);
        self.quarantine_if_damaged(&place, found)
    }

    /// Only the cage of a content, since a rest pose may be large. Otherwise as [`Self::content`].
    ///
    /// # Errors
    /// As [`Self::content`].
    pub fn content_cage(&self, key: &ContentKey) -> Result<Option<CageFile>, StoreError> {
        let place = self.files().contents().join(key.to_string());
        let found = self.describe(&place).and_then(|description| {
            let Some(Description { cage, .. }) = description else { return Ok(None) };
            let bytes = self.read_content_part(&place, "cage", &cage)?;
            Ok(Some(CageFile { name: cage.name, bytes }))
        });
        self.quarantine_if_damaged(&place, found)
    }

    /// Removes content, if it exists. A prepared solver of the key is kept.
    ///
    /// # Errors
    /// I/O errors.
    pub fn remove_content(&self, key: &ContentKey) -> Result<(), StoreError> {
        let _one_at_a_time = self.publishing();
        self.files().delete_durably(&self.files().contents().join(key.to_string()))
    }

    /// The keys of all content.
    ///
    /// # Errors
    /// I/O errors.
    pub fn contents(&self) -> Result<Vec<ContentKey>, StoreError> {
        let entries = self.files().list(&self.files().contents())?;
        Ok(entries.iter().filter_map(|entry| entry.name.to_str()?.parse().ok()).collect())
    }

    /// Whether anything is in quarantine.
    pub fn has_quarantined(&self) -> Result<bool, StoreError> {
        Ok(!self.files().list(&self.files().quarantine())?.is_empty())
    }

    /// Bytes of a content's files; 0 where there is none.
    pub fn content_bytes(&self, key: &ContentKey) -> u64 {
        let folder = self.files().contents().join(key.to_string());
        self.files().disk.list(&folder).map_or(0, |all| all.iter().map(|e| e.bytes).sum())
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
                self.files().sync_dir(&self.files().contents())?;
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

    fn read_content_part(&self, place: &Path, name: &str, part: &Part) -> Result<Vec<u8>, StoreError> {
        let path = place.join(name);
        let bytes = self.files().read(&path, part.bytes)?;
        let bytes = bytes.ok_or_else(|| StoreError::damaged(&path, "it is missing"))?;
        if bytes.len() as u64 != part.bytes || blake3::hash(&bytes).to_hex().as_str() != part.blake3 {
            return Err(StoreError::damaged(&path, "its content does not match its checksum"));
        }
        Ok(bytes)
    }

    fn read_content(&self, place: &Path) -> Result<Option<Content>, StoreError> {
        let Some(Description { rest, cage, matrix }) = self.describe(place)? else { return Ok(None) };
        let read = |name: &str, part: &Part| self.read_content_part(place, name, part);
        let matrix =
            matrix.map(|part| Ok(MatrixFile { bytes: read("matrix", &part)?, name: part.name })).transpose()?;
        Ok(Some(Content {
            rest: read("rest", &rest)?,
            cage: read("cage", &cage)?,
            rest_name: rest.name,
            cage_name: cage.name,
            matrix,
        }))
    }
}
