//! Sessions: metadata, container and completion mark.

use super::records::{RecordMeta, outcome_of};
use super::{ContentKey, Kind, Store, StoreError, StoredFile};
use cager_proto::messages::SessionOptions;
use cager_store::{Change, Key};
use serde::{Deserialize, Serialize};
use std::io::{self, BufWriter, Write};
use std::path::PathBuf;

/// Metadata of a session, fixed at its creation but for its name.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
pub struct SessionMeta {
    /// Its id; also the name of its folder.
    pub id: String,
    /// Tenant that owns it.
    pub tenant: String,
    /// Creation time, milliseconds since 1970.
    pub created_ms: u64,
    /// Key of its content and of its prepared solver.
    pub key: ContentKey,
    /// Version of the solver that solves its frames.
    #[serde(default)]
    pub solver_version: u32,
    /// Options as requested.
    pub options: SessionOptions,
    /// The name that it was given later.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub renamed: Option<String>,
    /// Digest of the inputs from which its cage was made, if the service made it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub made_cage: Option<ContentKey>,
    /// Idempotency key and fingerprint of the request that created it.
    pub idempotency: Option<Idempotency>,
}

/// A request that may be repeated.
#[derive(Clone, Debug, PartialEq, Eq, Deserialize, Serialize)]
pub struct Idempotency {
    /// The client's idempotency key.
    pub key: String,
    /// Digest of content and options of the request.
    pub fingerprint: String,
}

/// The completion mark of a session.
#[derive(Clone, Debug, PartialEq, Eq, Deserialize, Serialize)]
pub struct Completion {
    /// Number of frames.
    pub frames: u32,
    /// Length of the container.
    pub container_bytes: u64,
    /// Digest of the container, BLAKE3, hexadecimal.
    pub container_digest: String,
}

/// A written container.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Container {
    /// Its length.
    pub bytes: u64,
    /// Its digest, BLAKE3, hexadecimal.
    pub digest: String,
}

/// What a session takes on disk.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SessionBytes {
    /// Its files and its content.
    pub all: u64,
    /// Its container, which is one of them.
    pub container: u64,
}

impl RecordMeta for SessionMeta {
    const KIND: Kind = Kind::Session;

    fn id(&self) -> &str {
        &self.id
    }

    fn created_ms(&self) -> u64 {
        self.created_ms
    }
}

const CONTAINER: &str = "capture.cager";
/// Bytes of a container gathered before a write.
const BUFFER_BYTES: usize = 1 << 18;
/// What it is called where it is stored.
const COMPLETION: &str = "completion";

fn key(id: &str) -> Key<'_> {
    Key { kind: Kind::Session, id }
}

impl Store {
    /// Creates a session; durable on `Ok`.
    ///
    /// # Errors
    /// [`StoreError::Io`] with `AlreadyExists` where the id is taken.
    pub fn create_session(&self, meta: &SessionMeta) -> Result<(), StoreError> {
        self.create(meta, Vec::new(), |_| Ok(()))
    }

    /// Changes the metadata of a session; durable on `Ok`.
    ///
    /// # Errors
    /// Not found where it was deleted.
    pub fn change_session(&self, meta: &SessionMeta) -> Result<(), StoreError> {
        self.change(key(&meta.id), &[Change::Meta(self.sealed(SessionMeta::KIND.name(), meta)?)])
    }

    /// Atomically writes the session's container, replacing an existing one; durable on `Ok`. A [`StoreError`] inside the [`io::Error`]
    /// that `write` returns is unwrapped.
    ///
    /// # Errors
    /// Those of `write`.
    pub fn write_container(
        &self,
        id: &str,
        write: &mut dyn FnMut(&mut dyn Write) -> io::Result<()>,
    ) -> Result<Container, StoreError> {
        let folder = self.folder(Kind::Session, id)?;
        let (place, mut spool) = (folder.join(CONTAINER), self.spool()?);
        let mut buffered = BufWriter::with_capacity(BUFFER_BYTES, &mut spool);
        let written = write(&mut buffered).and_then(|()| buffered.flush());
        // What a failed write left in the buffer is of no use.
        drop(buffered.into_parts());
        written.map_err(|e| StoreError::of(&place, "write", e))?;
        let container = Container { bytes: spool.bytes(), digest: spool.digest().to_hex().to_string() };
        spool.move_to(&place)?;
        self.files().sync_dir(&folder)?;
        Ok(container)
    }

    /// Writes the completion mark, durably.
    pub fn complete<T: Serialize>(
        &self,
        id: &str,
        completion: &Completion,
        outcome: Option<&T>,
    ) -> Result<(), StoreError> {
        let mut changes = vec![Change::Completion(self.sealed(COMPLETION, completion)?)];
        if let Some(outcome) = outcome {
            changes.push(Change::Outcome(self.sealed(outcome_of(Kind::Session), outcome)?));
        }
        self.change(key(id), &changes)
    }

    /// Reads the completion mark; `None` if there is none.
    ///
    /// # Errors
    /// [`StoreError::Damaged`].
    pub fn completion(&self, id: &str) -> Result<Option<Completion>, StoreError> {
        let completion = self.record(Kind::Session, id)?.and_then(|record| record.completion);
        completion.map(|bytes| self.unsealed((Kind::Session, id), COMPLETION, &bytes)).transpose()
    }

    /// Length of the session's container; 0 where there is none.
    pub fn container_bytes(&self, id: &str) -> Result<u64, StoreError> {
        // Without opening it, which would fetch it where it is in a bucket.
        let folder = self.folder(Kind::Session, id)?;
        let entries = self.files().list(&folder)?;
        match entries.iter().find(|entry| entry.name == CONTAINER) {
            Some(entry) if entry.is_dir => {
                Err(StoreError::of(&folder.join(CONTAINER), "read", io::ErrorKind::IsADirectory.into()))
            }
            entry => Ok(entry.map_or(0, |entry| entry.bytes)),
        }
    }

    /// Bytes of the session's files, frames and content.
    pub fn bytes_of_session(&self, meta: &SessionMeta) -> Result<SessionBytes, StoreError> {
        let entries = self.files().list(&self.folder(Kind::Session, &meta.id)?)?;
        let container = entries.iter().find(|entry| entry.name == CONTAINER).map_or(0, |entry| entry.bytes);
        let own: u64 = entries.iter().map(|entry| entry.bytes).sum();
        let frames = self.frame_bytes(&meta.id)?;
        Ok(SessionBytes { all: own + frames + self.content_bytes(&meta.key)?, container })
    }

    /// Removes the session's container, if there is one. It may come back with a power cut.
    pub fn remove_container(&self, id: &str) -> Result<(), StoreError> {
        self.files().remove_file(&self.folder(Kind::Session, id)?.join(CONTAINER))
    }

    /// Verifies length and digest of the session's container, reading all of it; only the length where files are in a bucket.
    pub fn container_is_whole(&self, id: &str, completion: &Completion) -> Result<bool, StoreError> {
        if self.files().disk.is_elsewhere() {
            return Ok(self.container_bytes(id)? == completion.container_bytes);
        }
        let path = self.folder(Kind::Session, id)?.join(CONTAINER);
        let failed = |e| StoreError::of(&path, "read", e);
        let file = self.files().disk.open(&path).map_err(failed)?;
        let (mut digest, file) = (blake3::Hasher::new(), StoredFile::open(file).map_err(failed)?);
        let bytes = file.bytes();
        digest.update_reader(file).map_err(failed)?;
        let digest = digest.finalize().to_hex();
        Ok(bytes == completion.container_bytes && digest.as_str() == completion.container_digest)
    }

    /// Path of the session's container, whether or not it exists. For an invalid id it is a path where nothing exists.
    pub fn container_path(&self, id: &str) -> PathBuf {
        let folder = self.folder(Kind::Session, id).unwrap_or_else(|_| self.files().sessions.join(".no-session"));
        folder.join(CONTAINER)
    }
}
