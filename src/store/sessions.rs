//! Sessions: their metadata, container and mark of completion.

use super::disk::DiskFile;
use super::files::Files;
use super::found::{Kind, Stored};
use super::names::check_id;
use super::{ContentKey, Store, StoreError, is_session_id, meta};
use cager_proto::messages::SessionOptions;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use std::io::{self, Write};
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

/// What is known of a session from its creation on.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
pub struct SessionMeta {
    /// Its id; also the name of its folder.
    pub id: String,
    /// Whose it is.
    pub tenant: String,
    /// Creation time, milliseconds since 1970.
    pub created_ms: u64,
    /// Rest pose, cage and options.
    pub key: ContentKey,
    /// Version of the computation that its frames are solved with.
    #[serde(default)]
    pub solver_version: u32,
    /// Choices, as they were given.
    pub options: SessionOptions,
    /// Digest of the rest pose and the wish that its cage was made from, where none was sent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub made_cage: Option<ContentKey>,
    /// The request that made it, so that a repetition finds it.
    pub idempotency: Option<Idempotency>,
}

/// A request that may be repeated.
#[derive(Clone, Debug, PartialEq, Eq, Deserialize, Serialize)]
pub struct Idempotency {
    /// The client's name for it.
    pub key: String,
    /// Digest of what was asked.
    pub fingerprint: String,
}

/// That a session is complete.
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

impl Stored for SessionMeta {
    const KIND: Kind = Kind::Session;
    const FILE: &str = META;

    fn id(&self) -> &str {
        &self.id
    }

    fn all(files: &Files) -> PathBuf {
        files.sessions()
    }
}

const META: &str = "session.json";
const COMPLETE: &str = "complete.json";
const CONTAINER: &str = "capture.cager";
/// After this time a system that runs has written everything back.
const WRITTEN_BACK: Duration = Duration::from_secs(600);

impl Store {
    /// Makes a session: whole or not at all, durable on Ok.
    ///
    /// # Errors
    /// `AlreadyExists` as [`StoreError::Io`] where the id is taken; [`StoreError::BadId`], [`StoreError::Full`].
    pub fn create_session(&self, meta: &SessionMeta) -> Result<(), StoreError> {
        check_id(&meta.id)?;
        let files = self.files();
        let place = files.session(&meta.id);
        let bytes = meta::wrap(&place.join(META), "session", meta)?;
        files.publish_folder(&place, |aside| files.write_new(&aside.join(META), &bytes))
    }

    /// Deletes a session; fine where there is none. On Ok it does not come back; after an error it is there whole, or gone.
    ///
    /// # Errors
    /// [`StoreError::BadId`], or what the system says.
    pub fn delete_session(&self, id: &str) -> Result<(), StoreError> {
        check_id(id)?;
        self.files().throw_away(&self.files().session(id))
    }

    /// Moves a damaged session to `quarantine/`, with a note of what is wrong.
    ///
    /// # Errors
    /// [`StoreError::BadId`], or what the system says.
    pub fn quarantine_session(&self, id: &str, why: &str) -> Result<(), StoreError> {
        check_id(id)?;
        self.files().set_aside(&self.files().session(id), why).map(|_| ())
    }

    /// Writes the session's container, replacing one that is there: whole or not at all, durable on Ok. A [`StoreError`] that
    /// leaves `write` inside an [`io::Error`] comes out as it was.
    ///
    /// # Errors
    /// What `write` gives; [`StoreError::BadId`], [`StoreError::Full`].
    pub fn write_container(
        &self,
        id: &str,
        write: &mut dyn FnMut(&mut dyn Write) -> io::Result<()>,
    ) -> Result<Container, StoreError> {
        check_id(id)?;
        let files = self.files();
        let place = files.session(id).join(CONTAINER);
        let aside = files.temporary("container");
        let mut make = || {
            let file = files.create(&aside)?;
            let mut out =
                Hashed { file: &file, buffer: Vec::new(), bytes: 0, digest: blake3::Hasher::new(), broken: false };
            write(&mut out).and_then(|()| out.flush()).map_err(|e| StoreError::of(&place, "write", e))?;
            let container = Container { bytes: out.bytes, digest: out.digest.finalize().to_hex().to_string() };
            files.sync_file(&*file, &place)?;
            files.publish(&aside, &place)?;
            Ok(container)
        };
        make().inspect_err(|_| files.discard(&aside))
    }

    /// Marks the session complete, durably.
    ///
    /// # Errors
    /// [`StoreError::BadId`], [`StoreError::Full`].
    pub fn complete(&self, id: &str, completion: &Completion) -> Result<(), StoreError> {
        check_id(id)?;
        let path = self.files().session(id).join(COMPLETE);
        self.files().replace(&path, &meta::wrap(&path, "completion", completion)?)
    }

    /// The session's mark of completion; None where it has none. What this gives is durable.
    ///
    /// # Errors
    /// [`StoreError::Damaged`], [`StoreError::BadId`], or what the system says.
    pub fn completion(&self, id: &str) -> Result<Option<Completion>, StoreError> {
        check_id(id)?;
        let folder = self.files().session(id);
        let found: Option<Completion> = meta::read(self.files(), &folder.join(COMPLETE), "completion")?;
        if found.is_some() {
            // A process may have died between putting it there and syncing the folder. Not worth a sync for each old session.
            let entries = self.files().list(&folder)?;
            let old = |e: &super::disk::Entry| e.modified.elapsed().is_ok_and(|age| age > WRITTEN_BACK);
            if !entries.iter().all(old) {
                self.files().sync_dir(&folder)?;
            }
        }
        Ok(found)
    }

    /// Length of the session's container; 0 where there is none.
    ///
    /// # Errors
    /// [`StoreError::BadId`], or what the system says.
    pub fn container_bytes(&self, id: &str) -> Result<u64, StoreError> {
        check_id(id)?;
        let path = self.container_path(id);
        match self.files().disk.open(&path).and_then(|file| file.length()) {
            Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(0),
            length => length.map_err(|e| StoreError::of(&path, "read", e)),
        }
    }

    /// Whether the session's container is the one that was written: its length and digest. Reads all of it.
    ///
    /// # Errors
    /// [`StoreError::BadId`], or what the system says.
    pub fn container_is_whole(&self, id: &str, completion: &Completion) -> Result<bool, StoreError> {
        check_id(id)?;
        let path = self.container_path(id);
        let failed = |e| StoreError::of(&path, "read", e);
        let file = self.files().disk.open(&path).map_err(failed)?;
        let (mut digest, mut buffer, mut offset) = (blake3::Hasher::new(), vec![0; BUFFER_BYTES], 0);
        loop {
            let read = file.read_at(&mut buffer, offset).map_err(failed)?;
            if read == 0 {
                break;
            }
            digest.update(&buffer[..read]);
            offset += read as u64;
        }
        let digest = digest.finalize().to_hex();
        Ok(offset == completion.container_bytes && digest.as_str() == completion.container_digest)
    }

    /// Keeps a note of what was found out about the session, replacing an earlier one of that name: whole or not at all, durable
    /// on Ok. `name` is one of the program's own.
    ///
    /// # Errors
    /// [`StoreError::BadId`], [`StoreError::Full`].
    pub fn put_note<T: Serialize>(&self, id: &str, name: &'static str, note: &T) -> Result<(), StoreError> {
        check_id(id)?;
        let path = self.files().session(id).join(name).with_extension("json");
        self.files().replace(&path, &meta::wrap(&path, name, note)?)
    }

    /// A note of the session; None where there is none.
    ///
    /// # Errors
    /// [`StoreError::Damaged`], [`StoreError::BadId`].
    pub fn note<T: DeserializeOwned>(&self, id: &str, name: &'static str) -> Result<Option<T>, StoreError> {
        check_id(id)?;
        meta::read(self.files(), &self.files().session(id).join(name).with_extension("json"), name)
    }

    /// Where the session's container lies, or would. A name that is no id gives a path where nothing is.
    pub fn container_path(&self, id: &str) -> PathBuf {
        let id = if is_session_id(id) { id } else { ".no-session" };
        self.files().session(id).join(CONTAINER)
    }

    /// Bytes of the session's files; 0 where there is none.
    pub fn session_bytes(&self, id: &str) -> u64 {
        if !is_session_id(id) {
            return 0;
        }
        self.files().disk.list(&self.files().session(id)).map_or(0, |all| all.iter().map(|e| e.bytes).sum())
    }
}

/// Writes a file and computes its digest on the way.
struct Hashed<'a> {
    file: &'a Arc<dyn DiskFile>,
    buffer: Vec<u8>,
    bytes: u64,
    digest: blake3::Hasher,
    /// After an error there is a gap, whatever the caller makes of it.
    broken: bool,
}

/// Bytes gathered before a write.
const BUFFER_BYTES: usize = 1 << 18;

impl Hashed<'_> {
    fn put(&mut self, bytes: &[u8]) -> io::Result<()> {
        if self.broken {
            return Err(io::Error::other("an earlier write failed"));
        }
        self.file.write_all_at(bytes, self.bytes).inspect_err(|_| self.broken = true)?;
        self.digest.update(bytes);
        self.bytes += bytes.len() as u64;
        Ok(())
    }
}

impl Write for Hashed<'_> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        if self.buffer.len() + bytes.len() > BUFFER_BYTES {
            self.flush()?;
        }
        if bytes.len() >= BUFFER_BYTES {
            self.put(bytes)?;
        } else {
            self.buffer.extend_from_slice(bytes);
        }
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        let buffer = std::mem::take(&mut self.buffer);
        self.put(&buffer)?;
        self.buffer = buffer;
        self.buffer.clear();
        Ok(())
    }
}
