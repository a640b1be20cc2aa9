//! What handlers wait for, and what they answer where it does not come.

use super::content_encoding::is_packed_too_well;
use crate::problem::{self, ApiError};
use crate::service::Service;
use crate::session::facts::Facts;
use crate::session::{Phase, Session, gone};
use std::sync::Arc;
use std::time::Duration;
use tokio::time::{Instant, sleep_until};

/// Slowest transfer accepted, after an initial pause of `body_timeout_s`: an incomplete frame occupies memory from its first byte on.
pub(crate) const SLOWEST_BYTES_PER_SECOND: u64 = 16 << 10;
/// How long a request waits for its session to be prepared.
const PREPARE_TIMEOUT: Duration = Duration::from_secs(50);

/// Waits until the session is ready and returns the results of its preparation.
pub(crate) async fn prepared(service: &Service, session: &Arc<Session>) -> Result<Facts, ApiError> {
    let mut changes = session.changes();
    let deadline = Instant::now() + PREPARE_TIMEOUT;
    loop {
        changes.mark_unchanged();
        let status = session.status();
        match (status.phase, status.facts) {
            (Phase::Failed(problem), _) => {
                let detail = format!("the session failed: {}", problem.detail);
                return Err(ApiError::new(problem::SESSION_FAILED, detail));
            }
            (Phase::Preparing, _) | (_, None) => {}
            (_, Some(facts)) => {
                // It may have become ready since the request arrived.
                session.ensure_loaded().await?;
                return Ok(facts);
            }
        }
        tokio::select! {
            _ = changes.changed() => {}
            () = session.deleted().cancelled() => return Err(gone()),
            () = service.stopping().cancelled() => return Err(stopping()),
            () = sleep_until(deadline) => {
                let detail = "the session is still being prepared; wait until its state is ready";
                return Err(ApiError::new(problem::NOT_READY, detail).retry_after(2));
            }
        }
    }
}

pub(crate) fn stopping() -> ApiError {
    let detail = "the service is stopping; what was answered is kept, so post the rest when it is back";
    ApiError::new(problem::STOPPING, detail).retry_after(5)
}

pub(crate) fn too_slow() -> ApiError {
    ApiError::new(problem::REQUEST_TIMEOUT, "the body comes too slowly; send the rest again over a faster connection")
}

/// The response for an error while reading a body.
pub(crate) fn body_error(error: &(dyn std::error::Error + 'static)) -> ApiError {
    if super::listen::is_body_timeout(error) {
        return ApiError::new(problem::REQUEST_TIMEOUT, "the body stopped arriving; send the rest again");
    }
    if is_packed_too_well(error) {
        let detail = "the body unpacks to more than 100 times its length, and to more than 32 MiB; send fewer frames at a time, or send them as they are";
        return ApiError::new(problem::TOO_LARGE, detail);
    }
    ApiError::new(problem::BAD_REQUEST, format!("the body broke off ({error}); send the rest again"))
}

pub(crate) fn not_acceptable(available: &str) -> ApiError {
    ApiError::new(problem::NOT_ACCEPTABLE, format!("accept {available}"))
}
