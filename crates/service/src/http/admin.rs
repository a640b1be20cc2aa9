//! Routes for operators, on a separate listener without the limits of the public one.
//!
//! On a loopback address every client is an operator. On other addresses a token with the scope `admin` is needed, except for health and
//! metrics.

use super::audited::audited;
use super::extract::{Query, TokenName, granted};
use super::origin;
use super::respond::JsonResult;
use super::router::finished;
use super::sessions::{PAGE, PageQuery, page_of};
use crate::auth::Scope;
use crate::problem::{self, ApiError};
use crate::resources::ResourceUse;
use crate::service::Service;
use crate::tasks::blocking;
use axum::extract::{Path, Request, State};
use axum::middleware::{Next, from_fn, from_fn_with_state};
use axum::response::Response;
use axum::routing::{delete, get, post};
use axum::{Json, Router};
use cager_proto::messages::Session;
use http::{StatusCode, header};
use serde::Serialize;
use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Duration;

/// The router, with health and metrics as `seen` has them; with `open_to_all` no token is needed.
pub fn admin(service: Arc<Service>, seen: Router, open_to_all: bool) -> Router {
    let routes = Router::new()
        .route("/admin/tenants", get(tenants))
        .route("/admin/sessions", get(sessions))
        .route("/admin/sessions/{id}", delete(delete_session))
        .route("/admin/drain", post(drain))
        .route("/admin/evict", post(evict));
    let routes = routes.route_layer(from_fn_with_state(service.audit.clone(), audited));
    let routes = match open_to_all {
        true => routes.route_layer(from_fn(refuse_web_pages)),
        false => routes.route_layer(from_fn_with_state(Arc::clone(&service), require_admin)),
    };
    let routes = seen.merge(routes.with_state(service));
    let routes = routes.fallback(|| async { ApiError::new(problem::NOT_FOUND, "see the documentation for operators") });
    finished(routes)
}

/// Routes that web pages in the operator's browser do not reach, except for probes.
pub fn without_pages(routes: Router) -> Router {
    routes.layer(from_fn(refuse_web_pages))
}

async fn refuse_web_pages(request: Request, next: Next) -> Result<Response, ApiError> {
    if origin::is_probe(&request) {
        return Ok(next.run(request).await);
    }
    if request.headers().contains_key(header::ORIGIN) || !origin::is_this_machine(&request) {
        return Err(ApiError::new(problem::FORBIDDEN, "pages may not operate the service; use curl or a script"));
    }
    Ok(next.run(request).await)
}

/// Refuses requests without a token of the scope `admin`, and all requests of a service without tokens.
async fn require_admin(
    State(service): State<Arc<Service>>,
    mut request: Request,
    next: Next,
) -> Result<Response, ApiError> {
    let grant = granted(&service, request.headers()).await?;
    if !service.access.is_guarded() || grant.scope < Scope::Admin {
        service.rejected("scope");
        let detail = "operating the service from another machine needs a token whose scope is admin";
        return Err(ApiError::new(problem::FORBIDDEN, detail));
    }
    request.extensions_mut().insert(TokenName(Arc::clone(&grant.token)));
    Ok(next.run(request).await)
}

/// Resource usage of a tenant.
#[derive(Serialize)]
struct TenantUse {
    tenant: String,
    /// Sessions on disk.
    sessions: usize,
    /// Bytes on disk of sessions and cage jobs.
    stored_bytes: u64,
    /// Requests, streams and memory in use.
    #[serde(flatten)]
    holds: ResourceUse,
}

async fn tenants(State(service): State<Arc<Service>>) -> Json<Vec<TenantUse>> {
    let in_use = service.tenants_in_use();
    let mut tenants: BTreeMap<String, (usize, u64)> = in_use.into_iter().map(|tenant| (tenant, (0, 0))).collect();
    tenants.extend(service.usage().into_iter().map(|(tenant, sessions, bytes)| (tenant, (sessions, bytes))));
    let tenant = |(tenant, (sessions, stored_bytes)): (String, (usize, u64))| {
        let holds = service.holds(&tenant, service.solvers.in_flight_of(&tenant));
        TenantUse { tenant, sessions, stored_bytes, holds }
    };
    Json(tenants.into_iter().map(tenant).collect())
}

#[derive(Serialize)]
struct TenantSession {
    tenant: String,
    #[serde(flatten)]
    session: Session,
}

#[derive(Serialize)]
struct AllSessions {
    sessions: Vec<TenantSession>,
    next: Option<String>,
}

/// Sessions of all tenants, newest first, a hundred at a time.
async fn sessions(State(service): State<Arc<Service>>, Query(query): Query<PageQuery>) -> JsonResult<AllSessions> {
    let found = service.registry.page(None, query.after()?, PAGE + 1);
    let (page, next) = page_of(found, |session| session.meta.id.clone());
    let mut sessions = Vec::with_capacity(page.len());
    for session in page {
        // One whose frames cannot be read is listed without them.
        let _ = session.ensure_loaded().await;
        sessions.push(TenantSession { tenant: session.meta.tenant.clone(), session: session.view_with(0) });
    }
    Ok(Json(AllSessions { sessions, next }))
}

async fn delete_session(State(service): State<Arc<Service>>, Path(id): Path<String>) -> Result<StatusCode, ApiError> {
    let missing = || ApiError::new(problem::NOT_FOUND, "there is no session with this id");
    let session = service.registry.find_any(&id).ok_or_else(missing)?;
    tracing::info!(session = %id, tenant = %session.meta.tenant, "deleted by the operator");
    service.delete(&session).await?;
    Ok(StatusCode::NO_CONTENT)
}

/// Stops the process like a signal: running requests may finish within the drain time.
async fn drain(State(service): State<Arc<Service>>) -> StatusCode {
    tracing::info!("stopping, as the operator asked");
    service.stopping().cancel();
    StatusCode::ACCEPTED
}

#[derive(Serialize)]
struct Evicted {
    /// Of solvers.
    bytes: u64,
    /// Whose frames were forgotten.
    sessions: usize,
}

/// Drops cached solvers from memory, and frames of sessions that nobody uses at the moment. What is in use stays, and all can be loaded again.
async fn evict(State(service): State<Arc<Service>>) -> JsonResult<Evicted> {
    let bytes = service.solvers.evict();
    let sessions = blocking(move || service.registry.unload(Duration::ZERO)).await?;
    Ok(Json(Evicted { bytes, sessions }))
}
