//! What all long jobs have: files that were sent, and how often they were begun.

use super::records::RecordMeta;
use super::{Idempotency, Kind, Spool, Store, StoreError, StoredFile, StoredPart};
use cager_store::{Change, Key};
use std::path::PathBuf;

/// Metadata of a job, fixed at its creation.
pub(crate) trait JobMeta: RecordMeta + Clone + Send + Sync + 'static {
    /// Tenant that owns it.
    fn tenant(&self) -> &str;
    /// Idempotency key and fingerprint of the request that created it.
    fn idempotency(&self) -> Option<&Idempotency>;
    /// What it is called.
    fn name(&self) -> Option<&str>;
    /// Bytes that were sent with it.
    fn sent_bytes(&self) -> u64;
}

/// Implements [`JobMeta`] for metadata with `id`, `tenant`, `created_ms`, `options` and `idempotency`: its kind, and
/// the bytes that were sent.
macro_rules! job_meta {
    ($meta:ident, $kind:expr, |$of:ident| $sent:expr) => {
        impl $crate::store::RecordMeta for $meta {
            const KIND: $crate::store::Kind = $kind;

            fn id(&self) -> &str {
                &self.id
            }

            fn created_ms(&self) -> u64 {
                self.created_ms
            }
        }

        impl $crate::store::JobMeta for $meta {
            fn tenant(&self) -> &str {
                &self.tenant
            }

            fn idempotency(&self) -> Option<&Idempotency> {
                self.idempotency.as_ref()
            }

            fn name(&self) -> Option<&str> {
                self.options.name.as_deref()
            }

            fn sent_bytes(&self) -> u64 {
                let $of = self;
                $sent
            }
        }
    };
}
pub(super) use job_meta;

impl Store {
    /// Creates a job with its input; durable on `Ok`.
    pub(super) fn create_job<'a, M: JobMeta>(
        &self,
        meta: &M,
        parts: impl IntoIterator<Item = (&'a str, &'a [u8])>,
        spooled: Option<(&str, Spool)>,
    ) -> Result<(), StoreError> {
        let files = self.files();
        self.create(meta, Vec::new(), |staging| {
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

    /// Changes the number of attempts, durably; gives the new one.
    ///
    /// # Errors
    /// Not found where the job was deleted.
    pub(crate) fn set_attempts(
        &self,
        kind: Kind,
        id: &str,
        change: impl FnOnce(u32) -> u32,
    ) -> Result<u32, StoreError> {
        let attempts = change(self.record(kind, id)?.map_or(0, |record| record.attempts));
        self.change(Key { kind, id }, &[Change::Attempts(attempts)])?;
        Ok(attempts)
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
