//! Whether what is stored takes writes: tried once a second at most, one try at a time, and waited for no longer than a probe waits.

use crate::problem::{self, ApiError};
use crate::store::{Part, Store, StoreError};
use crate::sync::lock;
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};
use tokio::task::{JoinHandle, spawn_blocking};
use tokio::time::timeout;

/// How long a success is valid.
const VALIDITY: Duration = Duration::from_secs(1);
/// How long an answer may take, which is less than what asks waits, 5 s.
const PROBE_TIMEOUT: Duration = Duration::from_secs(4);

#[derive(Default)]
pub(crate) struct Readiness {
    probed: tokio::sync::Mutex<Probed>,
    /// What is being tried.
    part: Arc<Mutex<Part>>,
}

#[derive(Default)]
struct Probed {
    succeeded: Option<Instant>,
    /// One that takes too long goes on, and nobody begins another beside it.
    running: Option<JoinHandle<Result<(), StoreError>>>,
}

impl Readiness {
    /// Whether the store takes writes.
    ///
    /// # Errors
    /// Which part of it does not, or does not answer.
    pub(crate) async fn look(&self, store: &Store) -> Result<(), ApiError> {
        let failed = |what: String| ApiError::new(problem::STORAGE_FAILED, what).retry_after(60);
        let Ok(probed) = timeout(PROBE_TIMEOUT, self.probe(store)).await else {
            let part = lock(&self.part).name();
            tracing::error!(part, "not ready: it does not answer");
            return Err(failed(format!("{part} does not answer; see whether it hangs or is overloaded")));
        };
        probed?.map_err(|error| match error {
            full @ StoreError::Full { .. } => full.into(),
            other => {
                let part = lock(&self.part).name();
                tracing::error!(error = %other, part, "not ready");
                failed(format!("{part} takes no writes; the log has the reason"))
            }
        })
    }

    async fn probe(&self, store: &Store) -> Result<Result<(), StoreError>, ApiError> {
        let mut probed = self.probed.lock().await;
        if probed.succeeded.is_some_and(|then| then.elapsed() < VALIDITY) {
            return Ok(Ok(()));
        }
        let begin = || {
            let (store, part) = (store.clone(), Arc::clone(&self.part));
            spawn_blocking(move || store.probe(&part))
        };
        let outcome = probed.running.get_or_insert_with(begin).await;
        probed.running = None;
        let outcome = outcome.map_err(|error| ApiError::internal(&error))?;
        probed.succeeded = outcome.is_ok().then(Instant::now);
        Ok(outcome)
    }
}
