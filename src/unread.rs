//! Sessions and cage jobs whose files could not be read: left where they are, counted, and read again until they can be.

use crate::problem::{self, ApiError};
use crate::service::Service;
use crate::session::commit::storage_error;
use crate::session::create::blocking;
use crate::session::lock;
use crate::store::{CageJobMeta, Kind, SessionMeta, StoreError};
use std::collections::BTreeMap;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::sync::{Arc, Mutex};
use std::time::Instant;
use tokio::sync::MutexGuard;

/// What could not be read.
#[derive(Default)]
pub(crate) struct Unread {
    known: Mutex<BTreeMap<(Kind, String), Left>>,
    /// Held while one is read again or deleted. Never waited for in a thread that blocks: the holder may need one.
    reading: Arc<tokio::sync::Mutex<()>>,
    /// Whether rest poses and cages of no session may have been left for what could not be read.
    spared: AtomicBool,
}

/// One that could not be read.
#[derive(Clone)]
struct Left {
    /// Where it is known.
    tenant: Option<String>,
    /// When reading it again began last.
    tried: Option<Instant>,
}

impl Unread {
    /// Lists one more; the log has it once.
    pub(crate) fn add(&self, kind: Kind, id: &str, tenant: Option<&str>, why: &str) {
        self.spared.store(true, Relaxed);
        let key = (kind, id.to_owned());
        let mut known = lock(&self.known);
        let tried = known.get(&key).and_then(|left| left.tried);
        let before = known.insert(key, Left { tenant: tenant.map(str::to_owned), tried });
        drop(known);
        if before.is_none() {
            tracing::error!(kind = kind.name(), id, why, "cannot be read, and is left where it is");
        }
    }

    pub(crate) fn forget(&self, kind: Kind, id: &str) {
        lock(&self.known).remove(&(kind, id.to_owned()));
    }

    pub(crate) fn is_empty(&self) -> bool {
        lock(&self.known).is_empty()
    }

    /// Whether what was spared can go now. Says so once.
    pub(crate) fn may_forget(&self) -> bool {
        self.is_empty() && self.spared.swap(false, Relaxed)
    }

    pub(crate) fn count(&self, kind: Kind) -> usize {
        lock(&self.known).keys().filter(|(of, _)| *of == kind).count()
    }

    /// Keeps one from being read again meanwhile.
    pub(crate) async fn hold(&self, kind: Kind, id: &str) -> Option<MutexGuard<'_, ()>> {
        self.left(kind, id)?;
        Some(self.reading.lock().await)
    }

    fn left(&self, kind: Kind, id: &str) -> Option<Left> {
        lock(&self.known).get(&(kind, id.to_owned())).cloned()
    }

    /// What an operator should know; none where all could be read.
    pub(crate) fn summary(&self) -> Option<String> {
        let [sessions, jobs] = [Kind::Session, Kind::CageJob].map(|kind| self.count(kind));
        (sessions + jobs > 0).then(|| {
            format!(
                "{sessions} sessions and {jobs} cage designs cannot be read and are left where they are; the log has their paths, and they are served when they can be read"
            )
        })
    }
}

/// What a client hears of one.
pub(crate) fn problem(kind: Kind) -> ApiError {
    let kind = kind.name();
    let detail = format!(
        "the files of this {kind} cannot be read now; nothing of them was removed, so try again when the operator has looked at the disk"
    );
    ApiError::new(problem::STORAGE_FAILED, detail).retry_after(10)
}

impl Service {
    /// Takes in a session found on disk.
    pub(crate) fn take_in_session(self: &Arc<Self>, meta: SessionMeta) {
        let (id, tenant) = (meta.id.clone(), meta.tenant.clone());
        self.taken_in(Kind::Session, &id, &tenant, self.resume(meta));
    }

    /// Takes in a cage job found on disk.
    pub(crate) fn take_in_cage_job(self: &Arc<Self>, meta: CageJobMeta) {
        let (id, tenant) = (meta.id.clone(), meta.tenant.clone());
        self.taken_in(Kind::CageJob, &id, &tenant, self.resume_cage_job(meta));
    }

    fn taken_in(&self, kind: Kind, id: &str, tenant: &str, outcome: Result<(), StoreError>) {
        match outcome {
            Ok(()) => self.unread.forget(kind, id),
            Err(error) => self.unread.add(kind, id, Some(tenant), &error.to_string()),
        }
    }

    /// Reads one again if it could not be read before and may be the tenant's.
    ///
    /// # Errors
    /// It still cannot be read.
    pub(crate) async fn read_again(self: &Arc<Self>, kind: Kind, tenant: &str, id: &str) -> Result<(), ApiError> {
        match self.unread.left(kind, id) {
            Some(left) if left.tenant.as_deref().is_none_or(|owner| owner == tenant) => {
                self.read_now(kind, id.to_owned()).await
            }
            _ => Ok(()),
        }
    }

    /// Deletes one that could not be read, if there is one of that name; its rest pose and cage go once nothing is unread.
    ///
    /// # Errors
    /// What the system says.
    pub(crate) async fn delete_unread(self: &Arc<Self>, kind: Kind, id: &str) -> Result<bool, ApiError> {
        let Some(_one) = self.unread.hold(kind, id).await else { return Ok(false) };
        // It may have been read while this waited.
        if self.unread.left(kind, id).is_none() {
            return Ok(false);
        }
        let (store, removed) = (self.store.clone(), id.to_owned());
        let deleted = blocking(move || match kind {
            Kind::Session => store.delete_session(&removed),
            Kind::CageJob => store.delete_cage_job(&removed),
        });
        deleted.await?.map_err(|error| storage_error(&error))?;
        self.unread.forget(kind, id);
        Ok(true)
    }

    /// Reads all again that could not be read before.
    pub(crate) async fn read_all_again(self: &Arc<Self>) {
        let all: Vec<(Kind, String)> = lock(&self.unread.known).keys().cloned().collect();
        for (kind, id) in all {
            // The log has the reason since it was met.
            let _ = self.read_now(kind, id).await;
        }
    }

    async fn read_now(self: &Arc<Self>, kind: Kind, id: String) -> Result<(), ApiError> {
        let came = Instant::now();
        let one = Arc::clone(&self.unread.reading).lock_owned().await;
        match self.unread.left(kind, &id) {
            None => return Ok(()),
            // Somebody has read it since this was asked for.
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
                    service.store.find_again(&id).map(|meta| meta.map(|meta| service.take_in_session(meta)))
                }
                Kind::CageJob => {
                    service.store.find_again(&id).map(|meta| meta.map(|meta| service.take_in_cage_job(meta)))
                }
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
