//! `/v1/sessions`: creating, listing, reading, completing and deleting sessions.

use super::extract::{Body, Caller, Query, Requested, RequestedSession};
use super::multipart::{self, MATRIX};
use super::openapi;
use super::respond::JsonResult;
use crate::auth::Tenant;
use crate::problem::{self, ApiError};
use crate::service::Service;
use crate::session::cage_source::UploadedFiles;
use crate::session::create::NewSession;
use axum::Json;
use axum::extract::{Request, State};
use axum::response::{IntoResponse, Response};
use cager_proto::messages::{Complete, Rename, Session, SessionList, SessionState};
use http::{StatusCode, header};
use serde::Deserialize;
use std::sync::Arc;

pub(super) const PAGE: usize = 100;
/// Most missing ranges per session in a list.
const LISTED_RANGES: usize = 10;

/// Makes a session: parts `rest` and `cage` are files whose names carry their format, part `options` is JSON. Without a cage one is made
/// from the rest pose, or taken from a design, as `options.cage` says. It is prepared in the background; frames may be posted at once
/// and wait for it.
#[utoipa::path(
    post, path = "/v1/sessions", operation_id = "create_session", tag = "sessions",
    params(("Idempotency-Key" = Option<String>, Header, min_length = 1, max_length = 255, pattern = "^[ -~]+$", description = "A repetition with the same key and content gives the same session")),
    request_body(content = openapi::NewSessionForm, content_type = "multipart/form-data"),
    responses((status = 201, description = "The session, or the one that an earlier request with the same key made", body = Session,
        headers(("Location" = String, description = "Address of the session")))),
)]
pub(crate) async fn create(
    State(service): State<Arc<Service>>,
    Caller(tenant): Caller,
    request: Request,
) -> Result<Response, ApiError> {
    let new = read(&service, &tenant, request).await?;
    let session = service.create(&tenant, new).await?;
    // One that was made before may have to be read again. What cannot be read is told by its own address.
    let _ = session.ensure_loaded().await;
    let location = format!("/v1/sessions/{}", session.meta.id);
    Ok((StatusCode::CREATED, [(header::LOCATION, location)], Json(session.view())).into_response())
}

/// Reads the form that makes a session.
///
/// # Errors
/// Parts that are missing, twice there, unknown or too large; no room.
pub(super) async fn read(service: &Arc<Service>, tenant: &Tenant, request: Request) -> Result<NewSession, ApiError> {
    let words = ("rest, cage and options", "rest pose and cage");
    let mut form = multipart::read_files(service, tenant, request, &["rest", "cage", MATRIX], words).await?;
    let rest = form.take("rest", "the rest pose")?;
    let uploaded = UploadedFiles { rest, cage: form.files.remove("cage"), matrix: form.files.remove(MATRIX) };
    let multipart::Files { options, idempotency_key, room, .. } = form;
    Ok(NewSession { uploaded, options, idempotency_key, room })
}

/// Where a page begins.
#[derive(Debug, Deserialize, utoipa::IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub(crate) struct PageQuery {
    /// The `next` of the page before.
    #[param(pattern = "^[0-9a-f]{32}$")]
    after: Option<String>,
}

impl PageQuery {
    /// The id that the page follows.
    ///
    /// # Errors
    /// What was given is not an id.
    pub(super) fn after(&self) -> Result<Option<&str>, ApiError> {
        let is_id = |id: &&str| id.len() == 32 && id.bytes().all(|byte| matches!(byte, b'0'..=b'9' | b'a'..=b'f'));
        match self.after.as_deref() {
            Some(other) if !is_id(&other) => {
                let detail = "query: after: give the `next` of the page before; the first page has no `after`";
                Err(ApiError::new(problem::BAD_REQUEST, detail))
            }
            after => Ok(after),
        }
    }
}

/// A page of what was found, one more where there is one, and where the next page begins.
pub(super) fn page_of<T>(mut found: Vec<T>, id: impl FnOnce(&T) -> String) -> (Vec<T>, Option<String>) {
    let more = found.len() > PAGE;
    found.truncate(PAGE);
    let next = found.last().filter(|_| more).map(id);
    (found, next)
}

/// Lists the tenant's sessions, newest first, a hundred at a time; of missing frames the first ranges.
#[utoipa::path(get, path = "/v1/sessions", operation_id = "list_sessions", tag = "sessions", params(PageQuery), responses((status = 200, description = "A page of sessions", body = SessionList)))]
pub(crate) async fn list(
    State(service): State<Arc<Service>>,
    Caller(tenant): Caller,
    Query(query): Query<PageQuery>,
) -> JsonResult<SessionList> {
    let found = service.registry.page(Some(&tenant.name), query.after()?, PAGE + 1);
    let (page, next) = page_of(found, |session| session.meta.id.clone());
    let mut sessions = Vec::with_capacity(page.len());
    for session in &page {
        let loaded = session.ensure_loaded().await;
        let mut view = session.view_with(LISTED_RANGES);
        match loaded {
            // It is being deleted.
            Err(error) if error.problem.word() == problem::SESSION_DELETED.word => continue,
            // An unreadable session is listed as failed.
            Err(error) if view.state != SessionState::Failed => {
                (view.state, view.problem) = (SessionState::Failed, Some(*error.problem));
            }
            _ => {}
        }
        sessions.push(view);
    }
    Ok(Json(SessionList { sessions, next }))
}

/// A session.
#[utoipa::path(get, path = "/v1/sessions/{id}", operation_id = "get_session", tag = "sessions", params(openapi::Id), responses((status = 200, description = "The session", body = Session)))]
pub(crate) async fn get(RequestedSession { session, .. }: RequestedSession) -> Json<Session> {
    Json(session.view())
}

/// Gives a session another name. Its files stay as they are.
#[utoipa::path(patch, path = "/v1/sessions/{id}", operation_id = "rename_session", tag = "sessions", params(openapi::Id), request_body = Rename, responses((status = 200, description = "The session", body = Session)))]
pub(crate) async fn rename(
    RequestedSession { session, .. }: RequestedSession,
    Body(rename): Body<Rename>,
) -> JsonResult<Session> {
    session.rename(rename.name).await?;
    Ok(Json(session.view()))
}

/// Deletes a session with all that belongs to it; what runs for it stops.
#[utoipa::path(delete, path = "/v1/sessions/{id}", operation_id = "delete_session", tag = "sessions", params(openapi::Id), responses((status = 204, description = "It is gone")))]
pub(crate) async fn delete(
    State(service): State<Arc<Service>>,
    Requested(session): Requested<crate::session::Session>,
) -> Result<StatusCode, ApiError> {
    service.delete(&session).await?;
    Ok(StatusCode::NO_CONTENT)
}

/// Says that no more frames are coming, and writes the container. Repeating it changes nothing.
#[utoipa::path(
    post, path = "/v1/sessions/{id}/complete", operation_id = "complete_session", tag = "sessions", params(openapi::Id), request_body = Complete,
    responses((status = 200, description = "The completed session", body = Session)),
)]
pub(crate) async fn complete(
    State(service): State<Arc<Service>>,
    RequestedSession { session, .. }: RequestedSession,
    Body(complete): Body<Complete>,
) -> JsonResult<Session> {
    service.complete(&session, complete).await?;
    Ok(Json(session.view()))
}
