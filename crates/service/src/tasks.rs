//! Work beside what answers requests; a panic in it is an internal error of the request.

use crate::problem::ApiError;
use opentelemetry::trace::FutureExt as _;
use std::time::Duration;

/// Shortest and longest pause before something is tried again.
const PAUSES: [Duration; 2] = [Duration::from_millis(100), Duration::from_secs(5)];

/// Pauses between the tries of what fails for a while, each twice as long as the one before.
pub(crate) struct Pauses(Duration);

impl Pauses {
    pub(crate) fn new() -> Self {
        Self(PAUSES[0])
    }

    pub(crate) async fn next(&mut self) {
        let now = self.0;
        self.0 = (2 * now).min(PAUSES[1]);
        tokio::time::sleep(now).await;
    }
}

/// Runs a blocking closure on tokio's blocking pool.
pub(crate) async fn blocking<T: Send + 'static>(work: impl FnOnce() -> T + Send + 'static) -> Result<T, ApiError> {
    tokio::task::spawn_blocking(work).await.map_err(|error| ApiError::internal(&error))
}

/// Runs work to its end even if the client disconnects.
pub(crate) async fn to_the_end<T: Send + 'static>(
    work: impl Future<Output = Result<T, ApiError>> + Send + 'static,
) -> Result<T, ApiError> {
    tokio::spawn(work.with_current_context()).await.map_err(|error| ApiError::internal(&error))?
}
