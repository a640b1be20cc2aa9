//! Locks and the pool for work that blocks.

use crate::problem::ApiError;
use std::sync::{Mutex, MutexGuard, PoisonError};

/// Locks, ignoring poisoning: a panic while locked leaves no half-finished update.
pub(crate) fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Runs a blocking closure on tokio's blocking pool.
pub(crate) async fn blocking<T: Send + 'static>(work: impl FnOnce() -> T + Send + 'static) -> Result<T, ApiError> {
    tokio::task::spawn_blocking(work).await.map_err(|error| ApiError::internal(&error))
}
