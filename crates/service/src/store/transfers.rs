//! Transfers: what was sent, and what was made of it.

use super::jobs::job_meta;
use super::{Idempotency, Kind, NamedFile, Spool, Store, StoreError, StoredFile, StoredPart};
use cager_proto::transfer_messages::TransferOptions;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::PathBuf;

/// Metadata of a transfer, fixed at its creation.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
pub struct TransferMeta {
    /// Its id; also the name of its folder.
    pub id: String,
    /// Tenant that owns it.
    pub tenant: String,
    /// Creation time, milliseconds since 1970.
    pub created_ms: u64,
    /// Options as requested.
    pub options: TransferOptions,
    /// Points of the target.
    pub points: u32,
    /// Frames of the source.
    pub frames: u32,
    /// What is subtracted from the target's points, where they lie far away.
    pub origin: Option<[f64; 3]>,
    /// The files by the names of their parts: `target`, [`SOURCE`] or `source_rest` and [`SOURCE_FRAMES`], and perhaps `cage` and [`PAIRS`].
    pub parts: BTreeMap<String, StoredPart>,
    /// Idempotency key and fingerprint of the request that created it.
    pub idempotency: Option<Idempotency>,
}

job_meta!(TransferMeta, Kind::Transfer, |meta| meta.parts.values().map(|part| part.bytes).sum());

/// The part that is a whole container.
pub const SOURCE: &str = "source";
/// The part that says what corresponds.
pub const PAIRS: &str = "pairs";
/// The part that is frames of the source alone.
pub const SOURCE_FRAMES: &str = "source_frames";

impl Store {
    /// Creates a transfer; durable on `Ok`. The large part is on disk already.
    pub fn create_transfer(
        &self,
        meta: &TransferMeta,
        files: &BTreeMap<&'static str, NamedFile>,
        large: (&str, Spool),
    ) -> Result<(), StoreError> {
        self.create_job(meta, files.iter().map(|(name, file)| (*name, &file.bytes[..])), Some(large))
    }

    /// A part of a transfer that is not over, where there is one.
    ///
    /// # Errors
    /// [`StoreError::Damaged`].
    pub fn transfer_part(&self, meta: &TransferMeta, name: &str) -> Result<Option<NamedFile>, StoreError> {
        let Some(part) = meta.parts.get(name) else { return Ok(None) };
        let bytes = self.job_part(Kind::Transfer, &meta.id, name, part)?;
        Ok(Some(NamedFile { name: part.name.clone(), bytes }))
    }

    /// The frames of the source, with the name of their file; `None` where the source is a container.
    ///
    /// # Errors
    /// [`StoreError::Damaged`] where the length differs.
    pub fn transfer_frames<'a>(&self, meta: &'a TransferMeta) -> Result<Option<(&'a str, StoredFile)>, StoreError> {
        let Some(part) = meta.parts.get(SOURCE_FRAMES) else { return Ok(None) };
        self.open_job_part(Kind::Transfer, &meta.id, SOURCE_FRAMES, part).map(|file| Some((&part.name[..], file)))
    }

    /// Path of the source's container.
    pub fn transfer_source(&self, id: &str) -> Result<PathBuf, StoreError> {
        let path = self.job_file(Kind::Transfer, id, SOURCE)?;
        self.bring(&path).map(|()| path)
    }

    /// Removes the input of a transfer that is over, best effort: files that remain are removed at the next start.
    pub fn forget_transfer_input(&self, id: &str) {
        let sent = ["target", SOURCE, "source_rest", SOURCE_FRAMES, "cage", PAIRS];
        self.forget_files(Kind::Transfer, id, sent);
    }
}
