//! Work beside what answers requests; a panic in it is an internal error of the request.

use crate::problem::ApiError;
use opentelemetry::trace::FutureExt as _;

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
