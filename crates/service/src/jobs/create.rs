//! Creating a job: its input is looked at as long as the client waits, then it is stored and begun to the end.

use super::registry::Place;
use super::{Job, Phase, Work};
use crate::auth::Tenant;
use crate::idempotency::{create_once, made_before};
use crate::problem::{self, ApiError};
use crate::service::Service;
use crate::store::Idempotency;
use crate::tasks::{blocking, to_the_end};
use std::sync::Arc;
use std::time::{SystemTime, UNIX_EPOCH};

/// Id and creation time, milliseconds since 1970, of a new job.
pub(crate) fn new_job() -> (String, u64) {
    let now = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    (uuid::Uuid::now_v7().simple().to_string(), now.as_millis() as u64)
}

impl Service {
    /// Creates a job, at most once for a request with an idempotency key: `check` looks at the input and blocks, `make` stores what it gave. `may_be`
    /// as in [`made_before`].
    ///
    /// # Errors
    /// Those of `check` and `make`, and those of idempotency keys.
    pub(crate) async fn create_job<W, C, Making>(
        self: &Arc<Self>,
        tenant: &Arc<Tenant>,
        request: Option<Idempotency>,
        may_be: impl FnOnce(&Job<W>) -> bool,
        check: impl FnOnce() -> Result<C, ApiError> + Send + 'static,
        make: impl FnOnce(Arc<Self>, Arc<Tenant>, C, Option<Idempotency>) -> Making + Send + 'static,
    ) -> Result<Arc<Job<W>>, ApiError>
    where
        W: Work,
        C: Send + 'static,
        Making: Future<Output = Result<Arc<Job<W>>, ApiError>> + Send + 'static,
    {
        if let Some(made) = made_before(W::jobs(self), &tenant.name, request.as_ref(), may_be)? {
            return Ok(made);
        }
        let place = self.parse_slots.take(&tenant.name, 1).await;
        let checked = blocking(move || {
            let _place = place;
            check()
        });
        let checked = checked.await??;
        let (service, tenant) = (Arc::clone(self), Arc::clone(tenant));
        to_the_end(async move {
            let make = |request| make(Arc::clone(&service), Arc::clone(&tenant), checked, request);
            create_once(W::jobs(&service), &tenant.name, request, make).await
        })
        .await
    }

    /// A place for a new job among those of the tenant that wait.
    ///
    /// # Errors
    /// 429 where too many wait or are being stored.
    pub(crate) fn job_place<W: Work>(self: &Arc<Self>, tenant: &str) -> Result<Place<W>, ApiError> {
        let most = W::most_waiting(&self.config);
        if let Some(place) = W::jobs(self).place(Arc::clone(self), tenant, most) {
            return Ok(place);
        }
        self.rejected(W::QUEUE);
        let detail =
            format!("{most} of what you have at {} wait for their turn; try again later, or delete one", W::LIST);
        Err(ApiError::new(problem::TOO_MANY_JOBS, detail).limit(most as u64).retry_after(10))
    }

    /// Begins a job that is stored, in its place.
    pub(crate) fn begin_job<W: Work>(self: &Arc<Self>, place: Place<W>, meta: W::Meta, bytes: u64) -> Arc<Job<W>> {
        let job = Arc::new(Job::<W>::new(meta, Phase::Waiting, bytes));
        W::jobs(self).insert_at(place, Arc::clone(&job));
        W::begin(Arc::clone(self), Arc::clone(&job));
        job
    }
}
