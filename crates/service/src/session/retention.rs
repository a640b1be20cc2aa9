//! Storage quotas of tenants and deletion of expired sessions and jobs.

use super::idle;
use super::registry::Reserved;
use crate::audit::Change;
use crate::auth::Tenant;
use crate::cage_job::CageDesign;
use crate::jobs::{Jobs, Run, Work};
use crate::problem::{self, ApiError};
use crate::recovery::Recovery;
use crate::service::Service;
use crate::store::{JobMeta as _, RecordMeta as _};
use crate::tasks::blocking;
use crate::transfers::Transfer;
use std::sync::Arc;
use std::sync::atomic::Ordering::Relaxed;
use std::time::{Duration, SystemTime, UNIX_EPOCH};
use tokio_util::sync::CancellationToken;

const SWEEP_INTERVAL: Duration = Duration::from_secs(20);

impl Service {
    /// For every tenant that stores anything: number of sessions, and bytes of sessions and jobs.
    pub(crate) fn usage(&self) -> Vec<(String, usize, u64)> {
        let mut usage = std::collections::BTreeMap::<String, (usize, u64)>::new();
        for session in self.registry.all() {
            let entry = usage.entry(session.meta.tenant.clone()).or_default();
            entry.0 += 1;
            entry.1 += session.bytes.load(Relaxed);
        }
        fn taken<W: Work>(jobs: &Jobs<W>) -> impl Iterator<Item = (String, u64)> {
            jobs.all().into_iter().map(|job| (job.meta.tenant().to_owned(), job.bytes.load(Relaxed)))
        }
        let jobs = taken(&self.cage_jobs).chain(taken(&self.recoveries)).chain(taken(&self.transfers));
        for (tenant, bytes) in jobs {
            usage.entry(tenant).or_default().1 += bytes;
        }
        usage.into_iter().map(|(tenant, (sessions, bytes))| (tenant, sessions, bytes)).collect()
    }

    /// Reserves quota for one more session or job of `bytes` bytes.
    ///
    /// # Errors
    /// A quota that is used up.
    pub(crate) fn reserve(&self, tenant: &Tenant, bytes: u64) -> Result<Reserved, ApiError> {
        self.registry.reserve(&tenant.name, bytes, |usage| {
            let (count, used) = self.with_jobs(tenant, usage);
            if count >= tenant.limits.max_sessions {
                self.rejected("tenant_sessions");
                let detail = format!(
                    "you have {count} sessions, cage designs, recoveries and transfers; delete one that is not needed any more"
                );
                return Err(ApiError::new(problem::TOO_MANY_SESSIONS, detail).limit(tenant.limits.max_sessions));
            }
            self.bytes_allowed(tenant, used, bytes)
        })
    }

    /// Reserves quota for `bytes` more bytes of something that is being created.
    ///
    /// # Errors
    /// As [`Self::reserve`].
    pub(crate) fn reserve_more(&self, tenant: &Tenant, room: &mut Reserved, bytes: u64) -> Result<(), ApiError> {
        room.extend(bytes, |usage| self.bytes_allowed(tenant, self.with_jobs(tenant, usage).1, bytes))
    }

    /// Reserves quota for the next frames of an upload, `bytes` bytes each: for `most` of them, or for an eighth of those that there is room
    /// for, since others may need the rest.
    ///
    /// # Errors
    /// There is no room for one.
    pub(crate) fn reserve_frames(&self, tenant: &Tenant, bytes: u64, most: u64) -> Result<Reserved, ApiError> {
        self.registry.reserve_with(&tenant.name, 0, |usage| {
            let (_, used) = self.with_jobs(tenant, usage);
            self.bytes_allowed(tenant, used, bytes)?;
            let room = (tenant.limits.max_bytes - used) / bytes.max(1);
            Ok(bytes * (room / 8).clamp(1, most))
        })
    }

    fn with_jobs(&self, tenant: &Tenant, (count, used): (u64, u64)) -> (u64, u64) {
        let name = &tenant.name;
        let jobs = [self.cage_jobs.usage_of(name), self.recoveries.usage_of(name), self.transfers.usage_of(name)];
        jobs.into_iter().fold((count, used), |(count, used), (jobs, theirs)| (count + jobs, used + theirs))
    }

    /// Checks whether a tenant may store `bytes` more bytes.
    ///
    /// # Errors
    /// A quota that is used up.
    pub(crate) fn check_bytes(&self, tenant: &Tenant, bytes: u64) -> Result<(), ApiError> {
        let usage = self.registry.usage_of(&tenant.name);
        self.bytes_allowed(tenant, self.with_jobs(tenant, usage).1, bytes)
    }

    fn bytes_allowed(&self, tenant: &Tenant, used: u64, bytes: u64) -> Result<(), ApiError> {
        if used.saturating_add(bytes) <= tenant.limits.max_bytes {
            return Ok(());
        }
        self.rejected("tenant_bytes");
        let detail = format!(
            "your sessions, cage designs, recoveries and transfers take {used} of {} bytes, and this needs {bytes} more; delete those that are not needed any more",
            tenant.limits.max_bytes
        );
        Err(ApiError::new(problem::QUOTA_EXCEEDED, detail).limit(tenant.limits.max_bytes))
    }

    /// Periodically deletes what has expired, and forgets what idle sessions keep in memory, until `stop`.
    pub(crate) async fn sweep(self: Arc<Self>, stop: CancellationToken) {
        loop {
            tokio::select! {
                () = stop.cancelled() => return,
                () = tokio::time::sleep(SWEEP_INTERVAL) => {}
            }
            self.sweep_once().await;
        }
    }

    /// One round of [`Self::sweep`].
    pub(crate) async fn sweep_once(self: &Arc<Self>) {
        let now = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default().as_millis() as u64;
        let expired = |tenant: &str, created_ms: u64| {
            let most_s = self.access.tenant(tenant).limits.max_age_s;
            most_s > 0 && now.saturating_sub(created_ms) / 1000 >= most_s
        };
        self.delete_jobs::<CageDesign>(&expired).await;
        self.delete_jobs::<Recovery>(&expired).await;
        self.delete_jobs::<Transfer>(&expired).await;
        self.shape_spaces.forget_idle();
        for session in self.registry.all() {
            if expired(&session.meta.tenant, session.meta.created_ms) {
                tracing::info!(session = %session.meta.id, "deleted, because its time is over");
                metrics::counter!("cager_sessions_expired_total").increment(1);
                match self.delete(&session).await {
                    Ok(_) => self.note_expired(&session.meta.tenant, "/v1/sessions", &session.meta.id).await,
                    Err(error) => {
                        tracing::warn!(session = %session.meta.id, detail = %error.problem.detail, "could not be deleted");
                    }
                }
            } else {
                let retried = Arc::clone(&session);
                let _ = blocking(move || retried.retry_failed_writes()).await;
                session.forget_if_idle();
            }
        }
        let registry = Arc::clone(&self.registry);
        let _ = blocking(move || registry.unload(idle::IDLE)).await;
    }

    /// Deletes the jobs of a kind that have expired.
    async fn delete_jobs<W: Run>(self: &Arc<Self>, expired: &(dyn Fn(&str, u64) -> bool + Sync)) {
        for job in W::jobs(self).all() {
            if expired(job.meta.tenant(), job.meta.created_ms()) {
                tracing::info!(job = job.id(), "deleted, because its time is over");
                match self.delete_job(&job).await {
                    Ok(_) => self.note_expired(job.meta.tenant(), W::LIST, job.id()).await,
                    Err(error) => {
                        tracing::warn!(job = job.id(), detail = %error.problem.detail, "could not be deleted");
                    }
                }
            }
        }
    }

    /// Tells the audit file of what is deleted because its time is over.
    async fn note_expired(&self, tenant: &str, list: &str, id: &str) {
        let (audit, tenant, path) = (self.audit.clone(), tenant.to_owned(), format!("{list}/{id}"));
        let noted = blocking(move || {
            audit.note(&Change {
                time: SystemTime::now(),
                tenant: Some(&tenant),
                token: None,
                peer: None,
                action: "EXPIRE",
                path: &path,
                made: None,
                status: Some(204),
                request_id: None,
            });
        });
        let _ = noted.await;
    }
}
