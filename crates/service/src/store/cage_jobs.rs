//! Cage jobs: the input of a cage design, and the designed cage.

use super::jobs::job_meta;
use super::records::outcome_of;
use super::{ContentKey, Idempotency, Kind, Spool, Store, StoreError, StoredFile, StoredPart};
use cager_proto::cage_messages::CageOptions;
use cager_store::Change;
use serde::{Deserialize, Serialize};

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

job_meta!(CageJobMeta, Kind::CageJob, |meta| meta.rest.bytes + meta.frames.bytes);

const REST: &str = "rest";
const FRAMES: &str = "frames";
/// The file of the result.
pub const CAGE: &str = "cage.obj";
/// Upper bound of a cage's size, in bytes.
const CAGE_BYTES: u64 = 64 << 20;

impl Store {
    /// Creates a job with its input; durable on `Ok`.
    pub fn create_cage_job(&self, meta: &CageJobMeta, rest: &[u8], frames: Spool) -> Result<(), StoreError> {
        self.create_job(meta, [(REST, rest)], Some((FRAMES, frames)))
    }

    /// Creates a finished job without input; durable on `Ok`.
    pub fn create_finished_cage_job<T: Serialize>(
        &self,
        meta: &CageJobMeta,
        outcome: &T,
        cage: &[u8],
    ) -> Result<(), StoreError> {
        let outcome = self.sealed(outcome_of(Kind::CageJob), outcome)?;
        let files = self.files();
        self.create(meta, vec![Change::Outcome(outcome)], |staging| files.write_new(&staging.join(CAGE), cage))
    }

    /// The rest pose of a job that is not finished.
    ///
    /// # Errors
    /// [`StoreError::Damaged`].
    pub fn cage_job_rest(&self, meta: &CageJobMeta) -> Result<Vec<u8>, StoreError> {
        self.job_part(Kind::CageJob, &meta.id, REST, &meta.rest)
    }

    /// The frames of a job that is not finished. Their digest is not verified, since only a sample is read; each frame read is validated.
    ///
    /// # Errors
    /// [`StoreError::Damaged`] where the length differs.
    pub fn cage_job_frames(&self, meta: &CageJobMeta) -> Result<StoredFile, StoreError> {
        self.open_job_part(Kind::CageJob, &meta.id, FRAMES, &meta.frames)
    }

    /// The cage of a completed job, an OBJ file of this length and digest.
    ///
    /// # Errors
    /// [`StoreError::Damaged`].
    pub fn cage_job_cage(&self, id: &str, bytes: u64, digest: &str) -> Result<Vec<u8>, StoreError> {
        self.files().read_verified(&self.job_file(Kind::CageJob, id, CAGE)?, bytes.min(CAGE_BYTES), digest)
    }

    /// Removes the input of a finished job, best effort: files that remain are removed at the next start.
    pub fn forget_cage_job_input(&self, id: &str) {
        self.forget_files(Kind::CageJob, id, [REST, FRAMES]);
    }
}
