//! Sessions and jobs whose files could not be read: they stay in place and are retried until they can be read.

use crate::cage_job::CageDesign;
use crate::jobs::{Work, kind_of};
use crate::problem::{self, ApiError};
use crate::recovery::Recovery;
use crate::service::Service;
use crate::store::{FolderMeta as _, JobMeta as _, Kind, SessionMeta, StoreError};
use crate::sync::lock;
use crate::tasks::blocking;
use crate::transfers::Transfer;
use std::collections::BTreeMap;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::sync::{Arc, Mutex};
use std::time::Instant;
use tokio::sync::MutexGuard;

/// All unreadable sessions and jobs.
#[derive(Default)]
pub(crate) struct UnreadableFiles {
    known: Mutex<BTreeMap<(Kind, String), UnreadableEntry>>,
    /// Taken while one is retried or deleted. Never awaited on the blocking pool, since the holder may need one of its threads.
    reading: Arc<tokio::sync::Mutex<()>>,
    /// Whether there may be orphaned content.
    orphans_kept: AtomicBool,
}

/// An unreadable session or job.
#[derive(Clone)]
struct UnreadableEntry {
    /// Its tenant, if known.
    tenant: Option<String>,
    /// When the last retry began.
    tried: Option<Instant>,
}

impl UnreadableFiles {
    /// Adds one, or updates it; logged only the first time.
    pub(crate) fn add(&self, kind: Kind, id: &str, tenant: Option<&str>, why: &str) {
        self.look_for_orphans();
        let key = (kind, id.to_owned());
        let mut known = lock(&self.known);
        let tried = known.get(&key).and_then(|left| left.tried);
        let before = known.insert(key, UnreadableEntry { tenant: tenant.map(str::to_owned), tried });
        drop(known);
        if before.is_none() {
            tracing::error!(kind = kind.name(), id, why, "cannot be read, and is left where it is");
        }
    }

    /// Has orphaned content looked for in the next round.
    pub(crate) fn look_for_orphans(&self) {
        self.orphans_kept.store(true, Relaxed);
    }

    pub(crate) fn forget(&self, kind: Kind, id: &str) {
        lock(&self.known).remove(&(kind, id.to_owned()));
    }

    pub(crate) fn is_empty(&self) -> bool {
        lock(&self.known).is_empty()
    }

    /// Whether orphaned content should be looked for now; true once after the last unreadable one is gone.
    pub(crate) fn should_sweep_orphans(&self) -> bool {
        self.is_empty() && self.orphans_kept.swap(false, Relaxed)
    }

    pub(crate) fn count(&self, kind: Kind) -> usize {
        lock(&self.known).keys().filter(|(of, _)| *of == kind).count()
    }

    /// Prevents a retry while the guard is held; `None` if it is not listed.
    pub(crate) async fn hold(&self, kind: Kind, id: &str) -> Option<MutexGuard<'_, ()>> {
        self.left(kind, id)?;
        Some(self.reading.lock().await)
    }

    fn left(&self, kind: Kind, id: &str) -> Option<UnreadableEntry> {
        lock(&self.known).get(&(kind, id.to_owned())).cloned()
    }

    /// A summary for operators; `None` if everything could be read.
    pub(crate) fn summary(&self) -> Option<String> {
        let counts = Kind::ALL.map(|(kind, _)| self.count(kind));
        let [sessions, designs, recoveries, transfers] = counts;
        counts.iter().any(|count| *count > 0).then(|| {
            format!(
                "{sessions} sessions, {designs} cage designs, {recoveries} recoveries and {transfers} transfers cannot be read and are left where they are; the log has their paths, and they are served when they can be read"
            )
        })
    }
}

/// The response to a request for an unreadable one.
pub(crate) fn problem(kind: Kind) -> ApiError {
    let kind = kind.name();
    let detail = format!(
        "the files of this {kind} cannot be read at the moment; nothing was removed, so try again when the operator has checked the disk"
    );
    ApiError::new(problem::STORAGE_FAILED, detail).retry_after(10)
}

impl Service {
    /// Resumes a session found on disk and updates the list.
    pub(crate) fn resume_and_track_session(self: &Arc<Self>, meta: SessionMeta) {
        let (id, tenant) = (meta.id.clone(), meta.tenant.clone());
        self.track_outcome(Kind::Session, &id, &tenant, self.resume(meta));
    }

    /// Resumes a job found on disk and updates the list.
    pub(crate) fn resume_and_track_job<W: Work>(self: &Arc<Self>, meta: W::Meta) {
        let (id, tenant) = (meta.id().to_owned(), meta.tenant().to_owned());
        self.track_outcome(kind_of::<W>(), &id, &tenant, self.resume_job::<W>(meta));
    }

    fn reload_job<W: Work>(self: &Arc<Self>, id: &str) -> Result<Option<()>, StoreError> {
        Ok(self.store.reload_meta(id)?.map(|meta| self.resume_and_track_job::<W>(meta)))
    }

    fn track_outcome(&self, kind: Kind, id: &str, tenant: &str, outcome: Result<(), StoreError>) {
        match outcome {
            Ok(()) => self.unread.forget(kind, id),
            Err(error) => self.unread.add(kind, id, Some(tenant), &error.to_string()),
        }
    }

    /// Retries one if it is listed and may belong to the tenant.
    ///
    /// # Errors
    /// It still cannot be read.
    pub(crate) async fn retry_unreadable(self: &Arc<Self>, kind: Kind, tenant: &str, id: &str) -> Result<(), ApiError> {
        match self.unread.left(kind, id) {
            Some(left) if left.tenant.as_deref().is_none_or(|owner| owner == tenant) => {
                self.retry_now(kind, id.to_owned()).await
            }
            _ => Ok(()),
        }
    }

    /// Deletes an unreadable one; false if none is listed under this id. Its content is removed once nothing is unreadable.
    ///
    /// # Errors
    /// I/O errors.
    pub(crate) async fn delete_unread(self: &Arc<Self>, kind: Kind, id: &str) -> Result<bool, ApiError> {
        let Some(_one) = self.unread.hold(kind, id).await else { return Ok(false) };
        // It may have been read while this waited.
        if self.unread.left(kind, id).is_none() {
            return Ok(false);
        }
        let (store, removed) = (self.store.clone(), id.to_owned());
        let deleted = blocking(move || store.delete(kind, &removed));
        deleted.await??;
        self.unread.forget(kind, id);
        Ok(true)
    }

    /// Retries all that are listed.
    pub(crate) async fn retry_all_unreadable(self: &Arc<Self>) {
        let all: Vec<(Kind, String)> = lock(&self.unread.known).keys().cloned().collect();
        for (kind, id) in all {
            // The reason is logged already.
            let _ = self.retry_now(kind, id).await;
        }
    }

    async fn retry_now(self: &Arc<Self>, kind: Kind, id: String) -> Result<(), ApiError> {
        let came = Instant::now();
        let one = Arc::clone(&self.unread.reading).lock_owned().await;
        match self.unread.left(kind, &id) {
            None => return Ok(()),
            // It has been retried since this call.
            Some(left) if left.tried.is_some_and(|tried| tried >= came) => return Err(problem(kind)),
            Some(_) => {}
        }
        if let Some(left) = lock(&self.unread.known).get_mut(&(kind, id.clone())) {
            left.tried = Some(Instant::now());
        }
        let service = Arc::clone(self);
        blocking(move || {
            let _one = one;
            let found = match kind {
                Kind::Session => {
                    service.store.reload_meta(&id).map(|meta| meta.map(|meta| service.resume_and_track_session(meta)))
                }
                Kind::CageJob => service.reload_job::<CageDesign>(&id),
                Kind::Recovery => service.reload_job::<Recovery>(&id),
                Kind::Transfer => service.reload_job::<Transfer>(&id),
            };
            if matches!(found, Ok(None)) {
                service.unread.forget(kind, &id);
                tracing::info!(kind = kind.name(), id, "is gone");
                return Ok(());
            }
            if service.unread.left(kind, &id).is_some() {
                return Err(problem(kind));
            }
            tracing::info!(kind = kind.name(), id, "was read again");
            Ok(())
        })
        .await?
    }
}
