//! All cage jobs by id and tenant, and the idempotency keys that created them.

use super::{CageJob, Phase};
use crate::idempotency::{Keyed, Requests};
use crate::problem::{self, ApiError};
use crate::sync::lock;
use cager_proto::cage_messages::CageState;
use std::collections::BTreeMap;
use std::sync::atomic::Ordering::Relaxed;
use std::sync::{Arc, Mutex};

/// All jobs. Ids are in order of creation.
#[derive(Default)]
pub(crate) struct CageJobs {
    inner: Mutex<Inner>,
}

#[derive(Default)]
struct Inner {
    jobs: BTreeMap<String, Arc<CageJob>>,
    requests: Requests,
}

impl CageJobs {
    pub(crate) fn insert(&self, job: Arc<CageJob>) {
        let mut inner = lock(&self.inner);
        if let Some(idempotency) = &job.meta.idempotency {
            inner.requests.made(&job.meta.tenant, idempotency, &job.meta.id);
        }
        inner.jobs.insert(job.meta.id.clone(), job);
    }

    pub(crate) fn remove(&self, id: &str) {
        let mut inner = lock(&self.inner);
        if let Some(job) = inner.jobs.remove(id)
            && let Some(idempotency) = &job.meta.idempotency
        {
            inner.requests.forget(&job.meta.tenant, idempotency);
        }
    }

    /// A tenant's job; jobs of other tenants are not found.
    ///
    /// # Errors
    /// 404 where there is none.
    pub(crate) fn find(&self, tenant: &str, id: &str) -> Result<Arc<CageJob>, ApiError> {
        let inner = lock(&self.inner);
        inner.jobs.get(id).filter(|job| job.meta.tenant == tenant).cloned().ok_or_else(|| {
            ApiError::new(problem::NOT_FOUND, "there is no cage design with this id; list them at /v1/cages")
        })
    }

    /// Up to `most` of a tenant's jobs that follow `after`, newest first.
    pub(crate) fn page(&self, tenant: &str, after: Option<&str>, most: usize) -> Vec<Arc<CageJob>> {
        use std::ops::Bound::{Excluded, Unbounded};
        let inner = lock(&self.inner);
        let older = inner.jobs.range::<str, _>((Unbounded, after.map_or(Unbounded, Excluded))).rev();
        older.map(|(_, job)| job).filter(|job| job.meta.tenant == tenant).take(most).cloned().collect()
    }

    pub(crate) fn all(&self) -> Vec<Arc<CageJob>> {
        lock(&self.inner).jobs.values().cloned().collect()
    }

    /// Number of a tenant's jobs, and the bytes they take.
    pub(crate) fn usage_of(&self, tenant: &str) -> (u64, u64) {
        let inner = lock(&self.inner);
        let mine = inner.jobs.values().filter(|job| job.meta.tenant == tenant);
        mine.fold((0, 0), |(count, bytes), job| (count + 1, bytes + job.bytes.load(Relaxed)))
    }

    /// Number of jobs that run or wait.
    pub(crate) fn unfinished(&self) -> usize {
        lock(&self.inner).jobs.values().filter(|job| !job.state().is_final()).count()
    }

    /// Number of a tenant's jobs that wait.
    pub(crate) fn waiting_of(&self, tenant: &str) -> usize {
        let inner = lock(&self.inner);
        inner.jobs.values().filter(|job| job.meta.tenant == tenant && job.state() == CageState::Queued).count()
    }

    /// A job of the same input: a completed one, or else an unfinished one created before the job `before`.
    pub(super) fn duplicate(
        &self,
        tenant: &str,
        key: &crate::store::ContentKey,
        before: Option<&str>,
    ) -> Option<Arc<CageJob>> {
        let inner = lock(&self.inner);
        let same = || inner.jobs.values().filter(|job| job.meta.key == *key && job.meta.tenant == tenant);
        let completed = same().find(|job| matches!(job.phase(), Phase::Completed(_)));
        let earlier = || same().find(|job| before.is_some_and(|id| *job.meta.id < *id) && !job.state().is_final());
        completed.or_else(earlier).cloned()
    }
}

impl Keyed<CageJob> for CageJobs {
    fn requests<R>(&self, work: impl FnOnce(&mut Requests) -> R) -> R {
        work(&mut lock(&self.inner).requests)
    }

    fn made(&self, id: &str) -> Option<Arc<CageJob>> {
        lock(&self.inner).jobs.get(id).cloned()
    }
}
