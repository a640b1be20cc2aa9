//! Routes for operators, on a separate listener without the limits of the public one.
//!
//! On a loopback address every client is an operator. On other addresses a token with the scope `admin` is needed, except for health and
//! metrics.

use super::audited::audited;
use super::extract::{Query, TokenName, granted};
use super::respond::JsonResult;
use super::router::{finished, probes};
use super::sessions::{PAGE, PageQuery};
use super::{health, origin};
use crate::auth::Scope;
use crate::problem::{self, ApiError};
use crate::service::Service;
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

/// The router; with `open_to_all` no token is needed.
pub fn admin(service: Arc<Service>, open_to_all: bool) -> Router {
    let operated = Router::new()
        .route("/admin/tenants", get(tenants))
        .route("/admin/sessions", get(sessions))
        .route("/admin/sessions/{id}", delete(delete_session))
        .route("/admin/drain", post(drain))
        .route("/admin/evict", post(evict));
    let operated = operated.route_layer(from_fn_with_state(Arc::clone(&service), audited));
    let operated = match open_to_all {
        true => operated.route_layer(from_fn(refuse_web_pages)),
        false => operated.route_layer(from_fn_with_state(Arc::clone(&service), require_admin)),
    };
    let seen = Router::from(probes()).route("/metrics", get(health::operators_metrics));
    let routes = seen.merge(operated);
    let routes = routes.fallback(|| async { ApiError::new(problem::NOT_FOUND, "see the documentation for operators") });
    finished(routes.with_state(service))
}

/// Refuses requests from web pages in the operator's browser.
async fn refuse_web_pages(request: Request, next: Next) -> Result<Response, ApiError> {
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
    holds: crate::service::ResourceUse,
}

async fn tenants(State(service): State<Arc<Service>>) -> Json<Vec<TenantUse>> {
    let mut tenants: BTreeMap<String, (usize, u64)> =
        service.tenants_in_use().into_iter().map(|tenant| (tenant, (0, 0))).collect();
    tenants.extend(service.usage().into_iter().map(|(tenant, sessions, bytes)| (tenant, (sessions, bytes))));
    let tenant = |(tenant, (sessions, stored_bytes)): (String, (usize, u64))| {
        let holds = service.holds(&tenant);
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
    let mut page = service.registry.page(None, query.after.as_deref(), PAGE + 1);
    let more = page.len() > PAGE;
    page.truncate(PAGE);
    let next = page.last().filter(|_| more).map(|session| session.meta.id.clone());
    let listed = |session: &Arc<crate::session::Session>| TenantSession {
        tenant: session.meta.tenant.clone(),
        session: session.view_with(0),
    };
    Ok(Json(AllSessions { sessions: page.iter().map(listed).collect(), next }))
}

async fn delete_session(State(service): State<Arc<Service>>, Path(id): Path<String>) -> Result<StatusCode, ApiError> {
    let session = service.registry.find_any(&id)?;
    tracing::info!(session = %id, tenant = %session.meta.tenant, "deleted by the operator");
    service.delete(&session).await?;
    Ok(StatusCode::NO_CONTENT)
}

/// Stops the service like a signal: running requests may finish within the drain time.
async fn drain(State(service): State<Arc<Service>>) -> StatusCode {
    tracing::info!("stopping, as the operator asked");
    service.stopping().cancel();
    StatusCode::ACCEPTED
}

#[derive(Serialize)]
struct Evicted {
    bytes: u64,
}

/// Drops cached solvers from memory; solvers in use stay until they are released, and all can be loaded from disk again.
async fn evict(State(service): State<Arc<Service>>) -> Json<Evicted> {
    Json(Evicted { bytes: service.solvers.evict() })
}
