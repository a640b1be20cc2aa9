//! Completed sessions as what other work begins with.

use super::Phase;
use crate::problem::{self, ApiError};
use crate::service::Service;
use crate::tasks::blocking;
use std::path::PathBuf;
use std::sync::Arc;

impl Service {
    /// The container of a tenant's completed session.
    ///
    /// # Errors
    /// A session that is unknown, or not completed.
    pub(crate) async fn completed_container(self: &Arc<Self>, tenant: &str, id: &str) -> Result<PathBuf, ApiError> {
        let shortened: String = id.chars().take(80).collect();
        let unknown = |_| {
            let detail = format!("source_session: there is no session {shortened:?}; list yours at /v1/sessions");
            ApiError::new(problem::INVALID_OPTIONS, detail)
        };
        let session = self.registry.find(tenant, id).map_err(unknown)?;
        session.ensure_loaded().await?;
        let Phase::Completed(completion) = session.status().phase else {
            if let Some(problem) = session.container_problem() {
                return Err(problem);
            }
            let detail = format!(
                "source_session: {id} is not completed; post {{\"frames\": F}} to complete, and wait until it is"
            );
            return Err(ApiError::new(problem::NOT_COMPLETED, detail).retry_after(2));
        };
        let path = self.store.container_path(id);
        blocking(move || session.open_container(&completion).map(|_| path)).await?
    }
}
