//! Cage jobs: the input of a cage design, and the designed cage.

use super::files::Files;
use super::names::check_id;
use super::scan::{FolderMeta, Kind};
use super::{ContentKey, Idempotency, Spool, Store, StoreError, StoredFile, is_session_id, meta};
use cager_proto::cage_messages::CageOptions;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use std::io;
use std::path::PathBuf;

/// Metadata of a cage job, fixed at its creation.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
pub struct CageJobMeta {
    /// Its id; also the name of its folder.
    pub id: String,
    /// Tenant that owns it.
    pub tenant: String,
    /// Creation time, milliseconds since 1970.
    pub created_ms: u64,
    /// Digest of tenant, rest pose, frames and options; jobs with equal keys have the same cage.
    pub key: ContentKey,
    /// Options as requested.
    pub options: CageOptions,
    /// Points of the rest pose.
    pub points: u32,
    /// Number of frames.
    pub frame_count: u32,
    /// The rest pose.
    pub rest: StoredPart,
    /// The frames.
    pub frames: StoredPart,
    /// Idempotency key and fingerprint of the request that created it.
    pub idempotency: Option<Idempotency>,
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

impl FolderMeta for CageJobMeta {
    const KIND: Kind = Kind::CageJob;
    const FILE: &str = META;

    fn id(&self) -> &str {
        &self.id
    }

    fn all(files: &Files) -> PathBuf {
        files.cages()
    }
}

const META: &str = "job.json";
const OUTCOME: &str = "outcome.json";
const ATTEMPTS: &str = "attempts.json";
const REST: &str = "rest";
const FRAMES: &str = "frames";
const CAGE: &str = "cage.obj";
/// Upper bound of a cage's size, in bytes.
const CAGE_BYTES: u64 = 64 << 20;

impl Store {
    /// Creates a job with its input, atomically; durable on `Ok`.
    ///
    /// # Errors
    /// [`StoreError::BadId`], [`StoreError::Full`].
    pub fn create_cage_job(&self, meta: &CageJobMeta, rest: &[u8], frames: Spool) -> Result<(), StoreError> {
        check_id(&meta.id)?;
        let files = self.files();
        let place = files.cage_job(&meta.id);
        let bytes = meta::wrap(&place.join(META), "cage job", meta)?;
        files.publish_folder(&place, |staging| {
            files.write_new(&staging.join(META), &bytes)?;
            files.write_new(&staging.join(REST), rest)?;
            frames.move_to(&staging.join(FRAMES))
        })
    }

    /// Creates a finished job without input, atomically; durable on `Ok`.
    ///
    /// # Errors
    /// As [`Self::create_cage_job`].
    pub fn create_finished_cage_job<T: Serialize>(
        &self,
        meta: &CageJobMeta,
        outcome: &T,
        cage: &[u8],
    ) -> Result<(), StoreError> {
        check_id(&meta.id)?;
        let files = self.files();
        let place = files.cage_job(&meta.id);
        let bytes = meta::wrap(&place.join(META), "cage job", meta)?;
        let outcome = meta::wrap(&place.join(OUTCOME), "cage outcome", outcome)?;
        files.publish_folder(&place, |staging| {
            files.write_new(&staging.join(META), &bytes)?;
            files.write_new(&staging.join(CAGE), cage)?;
            files.write_new(&staging.join(OUTCOME), &outcome)
        })
    }

    /// The rest pose of a job that is not finished.
    ///
    /// # Errors
    /// [`StoreError::Damaged`], or another I/O error.
    pub fn cage_job_rest(&self, meta: &CageJobMeta) -> Result<Vec<u8>, StoreError> {
        self.cage_job_part(&meta.id, REST, meta.rest.bytes, &meta.rest.blake3)
    }

    /// The frames of a job that is not finished. Their digest is not verified, since only a sample is read; each frame read is validated.
    ///
    /// # Errors
    /// [`StoreError::Damaged`] where the length differs, or another I/O error.
    pub fn cage_job_frames(&self, meta: &CageJobMeta) -> Result<StoredFile, StoreError> {
        check_id(&meta.id)?;
        let path = self.files().cage_job(&meta.id).join(FRAMES);
        let file = match self.files().disk.open(&path).and_then(StoredFile::open) {
            Ok(file) => file,
            Err(error) if error.kind() == io::ErrorKind::NotFound => {
                return Err(StoreError::damaged(&path, "it is missing"));
            }
            Err(error) => return Err(StoreError::of(&path, "open", error)),
        };
        if file.bytes() != meta.frames.bytes {
            let what = format!("it has {} bytes where {} were stored", file.bytes(), meta.frames.bytes);
            return Err(StoreError::damaged(&path, what));
        }
        Ok(file)
    }

    /// Durably increments the number of attempts and returns it, so that a design that crashes the process is not retried at every start.
    ///
    /// # Errors
    /// [`StoreError::Full`], or another I/O error.
    pub fn count_cage_job_attempt(&self, id: &str) -> Result<u32, StoreError> {
        check_id(id)?;
        let path = self.files().cage_job(id).join(ATTEMPTS);
        // An unreadable counter restarts at 0.
        let before: u32 = meta::read(self.files(), &path, "attempts").ok().flatten().unwrap_or(0);
        self.files().replace(&path, &meta::wrap(&path, "attempts", &(before + 1))?)?;
        Ok(before + 1)
    }

    /// Decrements the number of attempts after an orderly stop.
    ///
    /// # Errors
    /// [`StoreError::Full`], or another I/O error; not found where the job was deleted.
    pub fn uncount_cage_job_attempt(&self, id: &str) -> Result<(), StoreError> {
        check_id(id)?;
        let path = self.files().cage_job(id).join(ATTEMPTS);
        let before: u32 = meta::read(self.files(), &path, "attempts").ok().flatten().unwrap_or(0);
        self.files().replace(&path, &meta::wrap(&path, "attempts", &before.saturating_sub(1))?)
    }

    /// Stores the outcome of a job and its cage, if any, and removes its input; durable on `Ok`.
    ///
    /// # Errors
    /// [`StoreError::BadId`], [`StoreError::Full`]; not found where the job was deleted.
    pub fn finish_cage_job<T: Serialize>(&self, id: &str, outcome: &T, cage: Option<&[u8]>) -> Result<(), StoreError> {
        check_id(id)?;
        let files = self.files();
        let folder = files.cage_job(id);
        if let Some(cage) = cage {
            files.replace(&folder.join(CAGE), cage)?;
        }
        let path = folder.join(OUTCOME);
        files.replace(&path, &meta::wrap(&path, "cage outcome", outcome)?)?;
        self.forget_cage_job_input(id);
        Ok(())
    }

    /// The outcome of a job; `None` if it is not finished.
    ///
    /// # Errors
    /// [`StoreError::Damaged`], [`StoreError::BadId`].
    pub fn cage_job_outcome<T: DeserializeOwned>(&self, id: &str) -> Result<Option<T>, StoreError> {
        check_id(id)?;
        meta::read(self.files(), &self.files().cage_job(id).join(OUTCOME), "cage outcome")
    }

    /// The cage of a completed job, an OBJ file of this length and digest.
    ///
    /// # Errors
    /// [`StoreError::Damaged`], or another I/O error.
    pub fn cage_job_cage(&self, id: &str, bytes: u64, digest: &str) -> Result<Vec<u8>, StoreError> {
        self.cage_job_part(id, CAGE, bytes.min(CAGE_BYTES), digest)
    }

    /// Removes the input of a finished job, best effort: files that remain are removed at the next start.
    pub fn forget_cage_job_input(&self, id: &str) {
        for name in [REST, FRAMES, ATTEMPTS] {
            let path = self.files().cage_job(id).join(name);
            match self.files().disk.remove_file(&path) {
                Err(error) if error.kind() != io::ErrorKind::NotFound => {
                    tracing::warn!(job = id, %error, "the input of a finished cage job still takes space");
                }
                _ => {}
            }
        }
    }

    /// Deletes a job, if it exists. On `Ok` the deletion is durable.
    ///
    /// # Errors
    /// [`StoreError::BadId`], or another I/O error.
    pub fn delete_cage_job(&self, id: &str) -> Result<(), StoreError> {
        check_id(id)?;
        self.files().delete_durably(&self.files().cage_job(id))
    }

    /// Moves a damaged job to `quarantine/`, with a note of what is wrong.
    ///
    /// # Errors
    /// [`StoreError::BadId`], or another I/O error.
    pub fn quarantine_cage_job(&self, id: &str, why: &str) -> Result<(), StoreError> {
        check_id(id)?;
        self.files().move_to_quarantine(&self.files().cage_job(id), why).map(|_| ())
    }

    /// Bytes of a job's files; 0 where there is none.
    pub fn cage_job_bytes(&self, id: &str) -> u64 {
        if !is_session_id(id) {
            return 0;
        }
        self.files().disk.list(&self.files().cage_job(id)).map_or(0, |all| all.iter().map(|e| e.bytes).sum())
    }

    fn cage_job_part(&self, id: &str, name: &str, bytes: u64, digest: &str) -> Result<Vec<u8>, StoreError> {
        check_id(id)?;
        let path = self.files().cage_job(id).join(name);
        let found = self.files().read(&path, bytes)?.ok_or_else(|| StoreError::damaged(&path, "it is missing"))?;
        if found.len() as u64 != bytes || blake3::hash(&found).to_hex().as_str() != digest {
            return Err(StoreError::damaged(&path, "its content does not match its checksum"));
        }
        Ok(found)
    }
}
