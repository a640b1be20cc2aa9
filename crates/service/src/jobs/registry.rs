//! All jobs of a kind by id and tenant, and the idempotency keys that created them.

use super::{Job, Work};
use crate::idempotency::{Keyed, KnownKeys};
use crate::problem::{self, ApiError};
use crate::store::JobMeta as _;
use crate::sync::lock;
use std::collections::BTreeMap;
use std::sync::atomic::Ordering::Relaxed;
use std::sync::{Arc, Mutex};

/// All jobs of a kind. Ids are in order of creation.
pub(crate) struct Jobs<W: Work> {
    inner: Mutex<Inner<W>>,
}

struct Inner<W: Work> {
    jobs: BTreeMap<String, Arc<Job<W>>>,
    requests: KnownKeys,
    /// The tenants of jobs that are being stored.
    coming: Vec<String>,
}

/// A place among a tenant's jobs that wait, for one that is being stored; free again when it is dropped.
pub(crate) struct Place<W: Work> {
    jobs: Arc<Jobs<W>>,
    /// None once the job is there.
    tenant: Option<String>,
}

impl<W: Work> Drop for Place<W> {
    fn drop(&mut self) {
        if let Some(tenant) = self.tenant.take() {
            lock(&self.jobs.inner).came(&tenant);
        }
    }
}

impl<W: Work> Inner<W> {
    fn insert(&mut self, job: Arc<Job<W>>) {
        if let Some(idempotency) = job.meta.idempotency() {
            self.requests.made(job.meta.tenant(), idempotency, job.id());
        }
        self.jobs.insert(job.id().to_owned(), job);
    }

    /// One job less is being stored.
    fn came(&mut self, tenant: &str) {
        if let Some(at) = self.coming.iter().position(|of| of == tenant) {
            self.coming.swap_remove(at);
        }
    }
}

impl<W: Work> Default for Jobs<W> {
    fn default() -> Self {
        Self { inner: Mutex::new(Inner { jobs: BTreeMap::new(), requests: KnownKeys::default(), coming: Vec::new() }) }
    }
}

impl<W: Work> Jobs<W> {
    pub(crate) fn insert(&self, job: Arc<Job<W>>) {
        lock(&self.inner).insert(job);
    }

    /// Inserts a job where a place was kept for it.
    pub(super) fn insert_at(&self, mut place: Place<W>, job: Arc<Job<W>>) {
        let mut inner = lock(&self.inner);
        inner.insert(job);
        if let Some(tenant) = place.tenant.take() {
            inner.came(&tenant);
        }
    }

    /// A place among a tenant's jobs that wait, of which there are so many; none where they are taken.
    pub(super) fn place(self: &Arc<Self>, tenant: &str, most: usize) -> Option<Place<W>> {
        let mut inner = lock(&self.inner);
        let mine = inner.jobs.values().filter(|job| job.meta.tenant() == tenant);
        let waiting = mine.filter(|job| W::waits(&job.status())).count();
        if waiting + inner.coming.iter().filter(|of| *of == tenant).count() >= most {
            return None;
        }
        inner.coming.push(tenant.to_owned());
        Some(Place { jobs: Arc::clone(self), tenant: Some(tenant.to_owned()) })
    }

    pub(crate) fn remove(&self, id: &str) {
        let mut inner = lock(&self.inner);
        if let Some(job) = inner.jobs.remove(id)
            && let Some(idempotency) = job.meta.idempotency()
        {
            inner.requests.forget(job.meta.tenant(), idempotency);
        }
    }

    /// A tenant's job; jobs of other tenants are not found.
    ///
    /// # Errors
    /// 404 where there is none.
    pub(crate) fn find(&self, tenant: &str, id: &str) -> Result<Arc<Job<W>>, ApiError> {
        let inner = lock(&self.inner);
        inner.jobs.get(id).filter(|job| job.meta.tenant() == tenant).cloned().ok_or_else(|| {
            let detail = format!("there is no {} with this id; list them at {}", W::NAME, W::LIST);
            ApiError::new(problem::NOT_FOUND, detail)
        })
    }

    /// Up to `most` of a tenant's jobs that follow `after`, newest first.
    pub(crate) fn page(&self, tenant: &str, after: Option<&str>, most: usize) -> Vec<Arc<Job<W>>> {
        use std::ops::Bound::{Excluded, Unbounded};
        let inner = lock(&self.inner);
        let older = inner.jobs.range::<str, _>((Unbounded, after.map_or(Unbounded, Excluded))).rev();
        older.map(|(_, job)| job).filter(|job| job.meta.tenant() == tenant).take(most).cloned().collect()
    }

    pub(crate) fn all(&self) -> Vec<Arc<Job<W>>> {
        lock(&self.inner).jobs.values().cloned().collect()
    }

    /// A tenant's jobs, oldest first.
    pub(crate) fn of(&self, tenant: &str) -> Vec<Arc<Job<W>>> {
        lock(&self.inner).jobs.values().filter(|job| job.meta.tenant() == tenant).cloned().collect()
    }

    /// Number of a tenant's jobs, and the bytes they take.
    pub(crate) fn usage_of(&self, tenant: &str) -> (u64, u64) {
        let inner = lock(&self.inner);
        let mine = inner.jobs.values().filter(|job| job.meta.tenant() == tenant);
        mine.fold((0, 0), |(count, bytes), job| (count + 1, bytes + job.bytes.load(Relaxed)))
    }

    /// Number of jobs that run or wait.
    pub(crate) fn unfinished(&self) -> usize {
        lock(&self.inner).jobs.values().filter(|job| !job.status().phase.is_final()).count()
    }
}

impl<W: Work> Keyed<Job<W>> for Jobs<W> {
    fn requests<R>(&self, work: impl FnOnce(&mut KnownKeys) -> R) -> R {
        work(&mut lock(&self.inner).requests)
    }

    fn made(&self, id: &str) -> Option<Arc<Job<W>>> {
        lock(&self.inner).jobs.get(id).cloned()
    }
}
