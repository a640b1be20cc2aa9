//! Creating a job: its input is looked at as long as the client waits, then it is stored and begun to the end.

use super::registry::Place;
use super::{Job, Phase, Run, Work};
use crate::admission::Permit;
use crate::auth::Tenant;
use crate::idempotency::{create_once, made_before};
use crate::problem::{self, ApiError};
use crate::service::Service;
use crate::session::registry::Reserved;
use crate::store::{Idempotency, JobMeta as _, Store, StoreError};
use crate::tasks::{blocking, to_the_end};
use std::sync::Arc;
use std::time::{SystemTime, UNIX_EPOCH};

/// Id and creation time, milliseconds since 1970, of a new job.
pub(crate) fn new_job() -> (String, u64) {
    let now = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    (uuid::Uuid::now_v7().simple().to_string(), now.as_millis() as u64)
}

/// A job whose input can be used.
pub(crate) struct Checked<W: Work> {
    pub(crate) meta: W::Meta,
    /// Stores it with its input, durably. Blocks.
    pub(crate) store: StoreJob<W>,
    /// Permit for the memory of the input.
    pub(crate) room: Permit,
    /// Quota for the part of the input that is on disk; none where no part is.
    pub(crate) reserved: Option<Reserved>,
    /// Bytes of the rest.
    pub(crate) unreserved: u64,
}

/// Stores a new job.
pub(crate) type StoreJob<W> = Box<dyn FnOnce(&Store, &<W as Work>::Meta) -> Result<(), StoreError> + Send>;

impl Service {
    /// Creates a job of what was sent, at most once for a request with an idempotency key, which `request_of` gives. `check` looks at the input. Both
    /// block. `may_be` as in [`made_before`].
    ///
    /// # Errors
    /// Those of `check`, of idempotency keys and of the store; a quota or a queue that is full.
    pub(crate) async fn create_job<W: Run, N: Send + 'static>(
        self: &Arc<Self>,
        tenant: &Arc<Tenant>,
        new: N,
        request_of: impl FnOnce(&N) -> Option<Idempotency> + Send + 'static,
        may_be: impl FnOnce(&Job<W>) -> bool,
        check: impl FnOnce(&Self, &Tenant, N, Option<Idempotency>) -> Result<Checked<W>, ApiError> + Send + 'static,
    ) -> Result<Arc<Job<W>>, ApiError> {
        let (new, request) = blocking(move || {
            let request = request_of(&new);
            (new, request)
        })
        .await?;
        if let Some(made) = made_before(&**W::jobs(self), &tenant.name, request.as_ref(), may_be)? {
            return Ok(made);
        }
        let place = self.parse_slots.take(&tenant.name, 1).await;
        let (service, owner, asked) = (Arc::clone(self), Arc::clone(tenant), request.clone());
        let checked = blocking(move || {
            let _place = place;
            check(&service, &owner, new, asked)
        });
        let checked = checked.await??;
        let (service, tenant) = (Arc::clone(self), Arc::clone(tenant));
        to_the_end(async move {
            let make = |_| service.make_job(&tenant, checked);
            create_once(&**W::jobs(&service), &tenant.name, request, make).await
        })
        .await
    }

    /// Stores a job and begins it, unless its results are known.
    async fn make_job<W: Run>(self: &Arc<Self>, tenant: &Tenant, checked: Checked<W>) -> Result<Arc<Job<W>>, ApiError> {
        let Checked { meta, store: write, room, reserved, unreserved } = checked;
        if let Some(job) = W::known(self, &meta).await {
            return Ok(job);
        }
        let place = self.job_place(&tenant.name)?;
        let _reserved = match reserved {
            Some(mut reserved) => {
                self.reserve_more(tenant, &mut reserved, unreserved)?;
                reserved
            }
            None => self.reserve(tenant, unreserved)?,
        };
        let store = self.store.clone();
        let stored = blocking(move || {
            let _room = room;
            write(&store, &meta).map(|()| meta)
        });
        let meta = stored.await??;
        let bytes = meta.sent_bytes();
        let job = Arc::new(Job::<W>::new(meta, Phase::Waiting, bytes));
        W::jobs(self).insert_at(place, Arc::clone(&job));
        Arc::clone(self).begin_job(Arc::clone(&job));
        Ok(job)
    }

    /// A place for a new job among those of the tenant that wait.
    ///
    /// # Errors
    /// 429 where too many wait or are being stored.
    fn job_place<W: Run>(&self, tenant: &str) -> Result<Place<W>, ApiError> {
        let most = W::most_waiting(&self.config);
        if let Some(place) = W::jobs(self).place(tenant, most) {
            return Ok(place);
        }
        self.rejected(W::QUEUE);
        let detail =
            format!("{most} of what you have at {} wait for their turn; try again later, or delete one", W::LIST);
        Err(ApiError::new(problem::TOO_MANY_JOBS, detail).limit(most as u64).retry_after(10))
    }
}
