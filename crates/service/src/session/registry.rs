//! All sessions by id and tenant, the idempotency keys that created them, and storage usage.

use super::Session;
use crate::idempotency::{Keyed, KnownKeys};
use crate::problem::{self, ApiError};
use crate::store::ContentKey;
use crate::sync::lock;
use std::collections::{BTreeMap, HashMap};
use std::sync::atomic::Ordering::Relaxed;
use std::sync::{Arc, Mutex};

/// All sessions. Ids are in order of creation.
#[derive(Default)]
pub(crate) struct Registry {
    inner: Mutex<Inner>,
    /// One lock per shard of content keys, taken while content is stored or removed: a removal must not race with a creation.
    contents: [tokio::sync::Mutex<()>; 16],
}

#[derive(Default)]
struct Inner {
    sessions: BTreeMap<String, Arc<Session>>,
    requests: KnownKeys,
    /// Number and bytes of sessions and cage jobs being created, by tenant.
    reserved: HashMap<String, (u64, u64)>,
}

impl Inner {
    fn usage_of(&self, tenant: &str) -> (u64, u64) {
        let reserved = self.reserved.get(tenant).copied().unwrap_or_default();
        let mine = self.sessions.values().filter(|session| session.meta.tenant == tenant);
        mine.fold(reserved, |(count, bytes), session| (count + 1, bytes + session.bytes.load(Relaxed)))
    }
}

/// Quota reserved for a session or cage job that is being created, or for frames on their way; released on drop.
pub(crate) struct Reserved {
    registry: Arc<Registry>,
    tenant: String,
    count: u64,
    bytes: u64,
}

impl Reserved {
    /// Reserves more bytes, as [`Registry::reserve`].
    ///
    /// # Errors
    /// Those of `allowed`.
    pub(crate) fn extend<E>(&mut self, bytes: u64, allowed: impl FnOnce((u64, u64)) -> Result<(), E>) -> Result<(), E> {
        let mut inner = lock(&self.registry.inner);
        allowed(inner.usage_of(&self.tenant))?;
        if let Some((_, reserved)) = inner.reserved.get_mut(&self.tenant) {
            *reserved += bytes;
        }
        self.bytes += bytes;
        Ok(())
    }

    /// Takes so many bytes of it, to be released on their own; `None` if there are not as many left.
    pub(crate) fn split(&mut self, bytes: u64) -> Option<Self> {
        self.bytes = self.bytes.checked_sub(bytes)?;
        Some(Self { registry: Arc::clone(&self.registry), tenant: self.tenant.clone(), count: 0, bytes })
    }
}

impl Drop for Reserved {
    fn drop(&mut self) {
        let mut inner = lock(&self.registry.inner);
        if let Some((count, bytes)) = inner.reserved.get_mut(&self.tenant) {
            *count -= self.count;
            *bytes -= self.bytes;
            if (*count, *bytes) == (0, 0) {
                inner.reserved.remove(&self.tenant);
            }
        }
    }
}

impl Registry {
    pub(crate) fn insert(&self, session: Arc<Session>) {
        let mut inner = lock(&self.inner);
        let meta = &session.meta;
        if let Some(idempotency) = &meta.idempotency {
            inner.requests.made(&meta.tenant, idempotency, &meta.id);
        }
        inner.sessions.insert(meta.id.clone(), session);
    }

    pub(crate) fn remove(&self, id: &str) -> Option<Arc<Session>> {
        let mut inner = lock(&self.inner);
        let session = inner.sessions.remove(id)?;
        if let Some(idempotency) = &session.meta.idempotency {
            inner.requests.forget(&session.meta.tenant, idempotency);
        }
        Some(session)
    }

    /// A tenant's session; sessions of other tenants are not found.
    ///
    /// # Errors
    /// 404 where there is none.
    pub(crate) fn find(&self, tenant: &str, id: &str) -> Result<Arc<Session>, ApiError> {
        let inner = lock(&self.inner);
        inner.sessions.get(id).filter(|session| session.meta.tenant == tenant).cloned().ok_or_else(|| {
            ApiError::new(problem::NOT_FOUND, "there is no session with this id; list them at /v1/sessions")
        })
    }

    /// A session of any tenant.
    pub(crate) fn find_any(&self, id: &str) -> Option<Arc<Session>> {
        lock(&self.inner).sessions.get(id).cloned()
    }

    /// At most `most` sessions that follow the id `after`, newest first; of all tenants if `tenant` is `None`.
    pub(crate) fn page(&self, tenant: Option<&str>, after: Option<&str>, most: usize) -> Vec<Arc<Session>> {
        use std::ops::Bound::{Excluded, Unbounded};
        let inner = lock(&self.inner);
        let older = inner.sessions.range::<str, _>((Unbounded, after.map_or(Unbounded, Excluded))).rev();
        older
            .map(|(_, session)| session)
            .filter(|session| tenant.is_none_or(|tenant| session.meta.tenant == tenant))
            .take(most)
            .cloned()
            .collect()
    }

    pub(crate) fn all(&self) -> Vec<Arc<Session>> {
        lock(&self.inner).sessions.values().cloned().collect()
    }

    /// Does something while no session is found, made or removed.
    pub(crate) fn with_sessions<T>(
        &self,
        work: impl FnOnce(std::collections::btree_map::Values<'_, String, Arc<Session>>) -> T,
    ) -> T {
        work(lock(&self.inner).sessions.values())
    }

    /// Number of a tenant's sessions and their bytes, including those being created.
    pub(crate) fn usage_of(&self, tenant: &str) -> (u64, u64) {
        lock(&self.inner).usage_of(tenant)
    }

    /// Atomically reserves quota for a session or cage job of `bytes` bytes if `allowed` accepts the usage so far (count and bytes of sessions).
    ///
    /// # Errors
    /// Those of `allowed`.
    pub(crate) fn reserve<E>(
        self: &Arc<Self>,
        tenant: &str,
        bytes: u64,
        allowed: impl FnOnce((u64, u64)) -> Result<(), E>,
    ) -> Result<Reserved, E> {
        self.reserve_with(tenant, 1, |usage| allowed(usage).map(|()| bytes))
    }

    /// As [`Self::reserve`], for as many bytes as `allowed` says, of `count` sessions.
    ///
    /// # Errors
    /// Those of `allowed`.
    pub(crate) fn reserve_with<E>(
        self: &Arc<Self>,
        tenant: &str,
        count: u64,
        allowed: impl FnOnce((u64, u64)) -> Result<u64, E>,
    ) -> Result<Reserved, E> {
        let mut inner = lock(&self.inner);
        let bytes = allowed(inner.usage_of(tenant))?;
        let entry = inner.reserved.entry(tenant.to_owned()).or_default();
        *entry = (entry.0 + count, entry.1 + bytes);
        Ok(Reserved { registry: Arc::clone(self), tenant: tenant.to_owned(), count, bytes })
    }

    /// Key of one of the tenant's contents whose cage was made from inputs with this digest.
    pub(crate) fn made_cage(&self, tenant: &str, made: &ContentKey) -> Option<ContentKey> {
        let inner = lock(&self.inner);
        let mut mine = inner.sessions.values().filter(|session| session.meta.tenant == tenant);
        mine.find(|session| session.meta.made_cage.as_ref() == Some(made)).map(|session| session.meta.key)
    }

    pub(crate) fn uses_content(&self, key: &ContentKey) -> bool {
        lock(&self.inner).sessions.values().any(|session| session.meta.key == *key)
    }

    /// Taken while content is stored or removed.
    pub(crate) async fn content_lock(&self, key: &ContentKey) -> tokio::sync::MutexGuard<'_, ()> {
        self.contents[usize::from(key.0[0]) % self.contents.len()].lock().await
    }
}

impl Keyed<Session> for Arc<Registry> {
    fn requests<R>(&self, work: impl FnOnce(&mut KnownKeys) -> R) -> R {
        work(&mut lock(&self.inner).requests)
    }

    fn made(&self, id: &str) -> Option<Arc<Session>> {
        lock(&self.inner).sessions.get(id).cloned()
    }
}
