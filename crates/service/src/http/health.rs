//! `/healthz`, `/readyz` and `/metrics`: answered outside all limits.

use super::extract::granted;
use super::listen::ConnectionHandle;
use crate::auth::Scope;
use crate::problem::{self, ApiError};
use crate::service::Service;
use crate::telemetry;
use axum::extract::State;
use axum::response::{IntoResponse, Response};
use axum::{Extension, Json};
use http::{HeaderMap, header};
use serde::Serialize;
use std::sync::Arc;

/// Health of the service.
#[derive(Serialize, utoipa::ToSchema)]
pub(crate) struct Health {
    /// `ok`.
    status: &'static str,
    /// Version of the program.
    version: &'static str,
    /// Seconds since it started.
    uptime_s: f64,
}

/// Health of a service that runs.
fn health(service: &Service) -> Json<Health> {
    let uptime_s = service.started.elapsed().as_secs_f64();
    Json(Health { status: "ok", version: env!("CARGO_PKG_VERSION"), uptime_s })
}

/// Liveness: the process answers.
#[utoipa::path(get, path = "/healthz", operation_id = "get_health", tag = "operation", security(()), responses((status = 200, description = "The process is running", body = Health)))]
pub(crate) async fn live(State(service): State<Arc<Service>>) -> Json<Health> {
    health(&service)
}

/// Readiness: sessions are resumed and the disk takes writes.
#[utoipa::path(get, path = "/readyz", operation_id = "get_readiness", tag = "operation", security(()), responses((status = 200, description = "The service is ready", body = Health)))]
pub(crate) async fn ready(State(service): State<Arc<Service>>) -> Result<Json<Health>, ApiError> {
    service.ready().await?;
    Ok(health(&service))
}

/// Metrics in Prometheus' text format. They name tenants: where the service has tokens, one of the scope `admin` is needed. The operators'
/// listener wants none.
#[utoipa::path(
    get, path = "/metrics", operation_id = "get_metrics", tag = "operation",
    responses((status = 200, description = "Metrics", content_type = "text/plain", body = String)),
)]
pub(crate) async fn metrics(
    State(service): State<Arc<Service>>,
    connection: Option<Extension<ConnectionHandle>>,
    headers: HeaderMap,
) -> Result<Response, ApiError> {
    if service.access.is_guarded() {
        let grant = granted(&service, &headers).await?;
        if let Some(Extension(connection)) = connection {
            connection.caller_is_known();
        }
        if grant.scope < Scope::Admin {
            service.rejected("scope");
            let detail = "metrics name tenants: use a token whose scope is admin, or the operators' listener";
            return Err(ApiError::new(problem::FORBIDDEN, detail));
        }
    }
    Ok(rendered_metrics(&service))
}

/// Metrics, as text.
pub(super) fn rendered_metrics(service: &Service) -> Response {
    telemetry::metrics::observe(service);
    let text = telemetry::metrics::recorder().render();
    ([(header::CONTENT_TYPE, "text/plain; version=0.0.4; charset=utf-8")], text).into_response()
}
