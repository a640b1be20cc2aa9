//! How much a tenant may keep and for how long.

use super::create::blocking;
use super::registry::Reserved;
use crate::auth::Tenant;
use crate::problem::{self, ApiError};
use crate::service::Service;
use std::sync::Arc;
use std::sync::atomic::Ordering::Relaxed;
use std::time::{Duration, SystemTime, UNIX_EPOCH};
use tokio_util::sync::CancellationToken;

const SWEEP_EVERY: Duration = Duration::from_secs(20);

impl Service {
    /// Sessions and bytes of every tenant that has any.
    pub(crate) fn usage(&self) -> Vec<(String, usize, u64)> {
        let mut usage = std::collections::BTreeMap::<String, (usize, u64)>::new();
        for session in self.registry.all() {
            let entry = usage.entry(session.meta.tenant.clone()).or_default();
            entry.0 += 1;
            entry.1 += session.bytes.load(Relaxed);
        }
        usage.into_iter().map(|(tenant, (sessions, bytes))| (tenant, sessions, bytes)).collect()
    }

    /// Room for one more session of so many bytes.
    ///
    /// # Errors
    /// A quota that is used up.
    pub(crate) fn reserve(&self, tenant: &Tenant, bytes: u64) -> Result<Reserved, ApiError> {
        self.registry.reserve(&tenant.name, bytes, |(sessions, used)| {
            if sessions >= tenant.limits.max_sessions {
                self.rejected("tenant_sessions");
                let detail = format!("you have {sessions} sessions; delete one that is not needed any more");
                return Err(ApiError::new(problem::TOO_MANY_SESSIONS, detail).limit(tenant.limits.max_sessions));
            }
            self.bytes_allowed(tenant, used, bytes)
        })
    }

    /// Whether a tenant may store so many bytes more.
    ///
    /// # Errors
    /// A quota that is used up.
    pub(crate) fn check_bytes(&self, tenant: &Tenant, bytes: u64) -> Result<(), ApiError> {
        let (_, used) = self.registry.usage_of(&tenant.name);
        self.bytes_allowed(tenant, used, bytes)
    }

    fn bytes_allowed(&self, tenant: &Tenant, used: u64, bytes: u64) -> Result<(), ApiError> {
        if used.saturating_add(bytes) <= tenant.limits.max_bytes {
            return Ok(());
        }
        self.rejected("tenant_bytes");
        let detail = format!(
            "your sessions take {used} of {} bytes, and this needs {bytes} more; delete sessions that are not needed any more",
            tenant.limits.max_bytes
        );
        Err(ApiError::new(problem::QUOTA_EXCEEDED, detail).limit(tenant.limits.max_bytes))
    }

    /// Deletes what is too old and closes what nobody uses, until the service stops.
    pub(crate) async fn sweep(self: Arc<Self>, stop: CancellationToken) {
        loop {
            tokio::select! {
                () = stop.cancelled() => return,
                () = tokio::time::sleep(SWEEP_EVERY) => {}
            }
            self.sweep_once().await;
        }
    }

    /// One round of [`Self::sweep`].
    pub(crate) async fn sweep_once(self: &Arc<Self>) {
        let now = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default().as_millis() as u64;
        for session in self.registry.all() {
            let limits = self.access.tenant(&session.meta.tenant).limits;
            let age_ms = now.saturating_sub(session.meta.created_ms);
            if limits.max_age_s > 0 && age_ms / 1000 >= limits.max_age_s {
                tracing::info!(session = %session.meta.id, "deleted, because its time is over");
                metrics::counter!("cager_sessions_expired_total").increment(1);
                if let Err(error) = self.delete(&session).await {
                    tracing::warn!(session = %session.meta.id, detail = %error.problem.detail, "could not be deleted");
                }
            } else {
                let mending = Arc::clone(&session);
                let _ = blocking(move || mending.mend()).await;
                session.rest_if_idle();
            }
        }
    }
}
