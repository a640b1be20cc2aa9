//! What all long jobs have in their folders beside their own files: how often they were begun, and their outcome.

use super::files::Files;
use super::scan::{self, FolderMeta, FolderScan, Kind};
use super::{Idempotency, Quarantined, Spool, Store, StoreError, StoredFile, StoredPart, Unreadable, meta};
use serde::Serialize;
use serde::de::DeserializeOwned;
use std::path::PathBuf;

/// Metadata of a job, fixed at its creation.
pub(crate) trait JobMeta: FolderMeta + Serialize + Clone + Send + Sync + 'static {
    /// Tenant that owns it.
    fn tenant(&self) -> &str;
    /// Creation time, milliseconds since 1970.
    fn created_ms(&self) -> u64;
    /// Idempotency key and fingerprint of the request that created it.
    fn idempotency(&self) -> Option<&Idempotency>;
    /// Bytes that were sent with it.
    fn sent_bytes(&self) -> u64;
}

/// Implements [`JobMeta`] for metadata with `id`, `tenant`, `created_ms` and `idempotency`: its kind, its file, and the bytes that were sent.
macro_rules! job_meta {
    ($meta:ident, $kind:expr, $file:expr, |$of:ident| $sent:expr) => {
        impl $crate::store::FolderMeta for $meta {
            const KIND: $crate::store::Kind = $kind;
            const FILE: &str = $file;

            fn id(&self) -> &str {
                &self.id
            }
        }

        impl $crate::store::JobMeta for $meta {
            fn tenant(&self) -> &str {
                &self.tenant
            }

            fn created_ms(&self) -> u64 {
                self.created_ms
            }

            fn idempotency(&self) -> Option<&Idempotency> {
                self.idempotency.as_ref()
            }

            fn sent_bytes(&self) -> u64 {
                let $of = self;
                $sent
            }
        }
    };
}
pub(super) use job_meta;

pub(super) const OUTCOME: &str = "outcome.json";
pub(super) const ATTEMPTS: &str = "attempts.json";

/// What its outcome is called in its file.
pub(super) fn outcome_of(kind: Kind) -> &'static str {
    match kind {
        Kind::CageJob => "cage outcome",
        Kind::Recovery => "recovery outcome",
        Kind::Transfer => "transfer outcome",
        Kind::Session => "outcome",
    }
}

/// Reads the metadata of all jobs of a kind, oldest first.
pub(super) fn find<M: JobMeta>(
    files: &Files,
    quarantined: &mut Vec<Quarantined>,
    unread: &mut Vec<Unreadable>,
) -> Result<Vec<M>, StoreError> {
    let FolderScan { mut metas, quarantined: damaged, unread: more } = scan::find::<M>(files)?;
    quarantined.extend(damaged);
    unread.extend(more);
    metas.sort_by(|a, b| (a.created_ms(), a.id()).cmp(&(b.created_ms(), b.id())));
    Ok(metas)
}

impl Store {
    /// Creates a job with its input, atomically; durable on `Ok`.
    pub(super) fn create_job<'a, M: JobMeta>(
        &self,
        meta: &M,
        parts: impl IntoIterator<Item = (&'a str, &'a [u8])>,
        spooled: Option<(&str, Spool)>,
    ) -> Result<(), StoreError> {
        let (files, place) = (self.files(), self.folder(M::KIND, meta.id())?);
        let bytes = meta::wrap(&place.join(M::FILE), M::KIND.name(), meta)?;
        files.publish_folder(&place, |staging| {
            files.write_new(&staging.join(M::FILE), &bytes)?;
            for (name, bytes) in parts {
                files.write_new(&staging.join(name), bytes)?;
            }
            spooled.map_or(Ok(()), |(name, spool)| spool.move_to(&staging.join(name)))
        })
    }

    /// Path of a file of a job, for reading.
    pub fn job_file(&self, kind: Kind, id: &str, name: &str) -> Result<PathBuf, StoreError> {
        Ok(self.folder(kind, id)?.join(name))
    }

    /// The content of a file of a job.
    ///
    /// # Errors
    /// [`StoreError::Damaged`].
    pub(super) fn job_part(&self, kind: Kind, id: &str, name: &str, part: &StoredPart) -> Result<Vec<u8>, StoreError> {
        self.files().read_verified(&self.job_file(kind, id, name)?, part.bytes, &part.blake3)
    }

    /// A large file of a job, open for reading. Its digest is not verified.
    ///
    /// # Errors
    /// [`StoreError::Damaged`] where the length differs.
    pub(super) fn open_job_part(
        &self,
        kind: Kind,
        id: &str,
        name: &str,
        part: &StoredPart,
    ) -> Result<StoredFile, StoreError> {
        let path = self.job_file(kind, id, name)?;
        let file = StoredFile::open(self.files().open_expected(&path)?);
        let file = file.map_err(|e| StoreError::of(&path, "open", e))?;
        if file.bytes() != part.bytes {
            let what = format!("it has {} bytes where {} were stored", file.bytes(), part.bytes);
            return Err(StoreError::damaged(&path, what));
        }
        Ok(file)
    }

    /// Durably increments the number of attempts and returns it, so that a job that crashes the process is not retried at every start.
    pub fn count_attempt(&self, kind: Kind, id: &str) -> Result<u32, StoreError> {
        self.set_attempts(kind, id, |before| before + 1)
    }

    /// Decrements the number of attempts after an orderly stop.
    ///
    /// # Errors
    /// Not found where the job was deleted.
    pub fn uncount_attempt(&self, kind: Kind, id: &str) -> Result<(), StoreError> {
        self.set_attempts(kind, id, |before| before.saturating_sub(1)).map(|_| ())
    }

    /// Sets the number of attempts to 0, after progress.
    ///
    /// # Errors
    /// Not found where the job was deleted.
    pub fn forget_attempts(&self, kind: Kind, id: &str) -> Result<(), StoreError> {
        let path = self.folder(kind, id)?.join(ATTEMPTS);
        match meta::read::<u32>(self.files(), &path, "attempts") {
            Ok(None | Some(0)) => Ok(()),
            _ => self.set_attempts(kind, id, |_| 0).map(|_| ()),
        }
    }

    fn set_attempts(&self, kind: Kind, id: &str, change: impl FnOnce(u32) -> u32) -> Result<u32, StoreError> {
        let path = self.folder(kind, id)?.join(ATTEMPTS);
        // An unreadable counter restarts at 0.
        let attempts = change(meta::read(self.files(), &path, "attempts").ok().flatten().unwrap_or(0));
        self.files().replace(&path, &meta::wrap(&path, "attempts", &attempts)?)?;
        Ok(attempts)
    }

    /// Stores the outcome of a job; durable on `Ok`.
    ///
    /// # Errors
    /// Not found where the job was deleted.
    pub(crate) fn set_job_outcome<T: Serialize>(&self, kind: Kind, id: &str, outcome: &T) -> Result<(), StoreError> {
        let path = self.folder(kind, id)?.join(OUTCOME);
        self.files().replace(&path, &meta::wrap(&path, outcome_of(kind), outcome)?)
    }

    /// The outcome of a job; `None` if it is not finished.
    ///
    /// # Errors
    /// [`StoreError::Damaged`].
    pub fn job_outcome<T: DeserializeOwned>(&self, kind: Kind, id: &str) -> Result<Option<T>, StoreError> {
        meta::read(self.files(), &self.folder(kind, id)?.join(OUTCOME), outcome_of(kind))
    }

    /// Removes the input of a job that is over, best effort: files that remain are removed at the next start.
    pub(super) fn forget_files(&self, kind: Kind, id: &str, names: impl IntoIterator<Item = impl AsRef<str>>) {
        for name in names {
            let removed =
                self.folder(kind, id).and_then(|folder| self.files().remove_file(&folder.join(name.as_ref())));
            if let Err(error) = removed {
                tracing::warn!(job = id, %error, "the input of a job that is over still takes space");
            }
        }
    }
}
