//! The routes of a process that has shards: its own health and metrics, and everything else as [`Shards`] answers it.

use super::Shards;
use crate::http::listen::ConnectionHandle;
use crate::http::{finished, health, may_see_metrics, rendered_metrics};
use crate::problem::{self, ApiError};
use crate::sync::lock;
use axum::extract::{Request, State};
use axum::response::{IntoResponse, Response};
use axum::routing::get;
use axum::{Extension, Router};
use futures_util::future::try_join_all;
use http::HeaderMap;
use std::sync::Arc;
use std::time::Duration;

/// A process that has not seen for so long who has which shard is not ready.
const UNSEEN: Duration = Duration::from_secs(5);

/// All routes.
pub(crate) fn answered(shards: Arc<Shards>) -> Router {
    let all = async |State(shards): State<Arc<Shards>>, request: Request| shards.answer(request).await;
    finished(seen(Arc::clone(&shards))).merge(Router::new().fallback(all).with_state(shards))
}

/// Health and metrics, for the public listener.
pub(crate) fn seen(shards: Arc<Shards>) -> Router {
    probes().route("/metrics", get(metrics)).with_state(shards)
}

/// Health and metrics, for operators.
pub(crate) fn seen_by_operators(shards: Arc<Shards>) -> Router {
    let metrics = |State(shards): State<Arc<Shards>>| async move { shards.metrics() };
    probes().route("/metrics", get(metrics)).with_state(shards)
}

fn probes() -> Router<Arc<Shards>> {
    let live = |State(shards): State<Arc<Shards>>| async move { health(&shards.resources) };
    Router::new().route("/healthz", get(live)).route("/readyz", get(ready))
}

/// It sees who has which shard, and its own take writes. One without any sends all requests on.
async fn ready(State(shards): State<Arc<Shards>>) -> Result<Response, ApiError> {
    if shards.stop.is_cancelled() {
        return Err(ApiError::new(problem::STOPPING, "the process is stopping").retry_after(5));
    }
    if lock(&shards.seen_at).elapsed() > UNSEEN {
        let detail = "the database does not answer; the log has the reason";
        return Err(ApiError::new(problem::STORAGE_FAILED, detail).retry_after(5));
    }
    let services = shards.services();
    let all = try_join_all(services.iter().map(|service| service.ready()));
    all.await?;
    Ok(health(&shards.resources).into_response())
}

async fn metrics(
    State(shards): State<Arc<Shards>>,
    connection: Option<Extension<ConnectionHandle>>,
    headers: HeaderMap,
) -> Result<Response, ApiError> {
    may_see_metrics(&shards.resources, connection.map(|Extension(connection)| connection), &headers).await?;
    Ok(shards.metrics())
}

impl Shards {
    fn metrics(&self) -> Response {
        let services = self.services();
        metrics::gauge!("cager_shards").set(services.len() as f64);
        rendered_metrics(&self.resources, &services)
    }
}
