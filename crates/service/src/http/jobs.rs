//! What the routes of all kinds of jobs share: the response to a new one, a page of them, events, deletion, results.

use super::extract::Query;
use super::progress::{self, ProgressEvent, ProgressSource};
use super::ranged::Immutable;
use super::sessions::{PAGE, PageQuery, page_of};
use crate::admission::Permit;
use crate::auth::Tenant;
use crate::jobs::{Job, Run, Work, kind_of};
use crate::problem::{self, ApiError};
use crate::service::Service;
use crate::tasks::blocking;
use axum::Json;
use axum::response::{IntoResponse, Response};
use http::header::CONTENT_DISPOSITION;
use http::{HeaderMap, HeaderValue, StatusCode, header};
use serde::Serialize;
use std::ops::Range;
use std::sync::Arc;

/// The response to a request that made a job, or found the one that it made before.
pub(super) fn accepted<W: Work>(job: &Job<W>, view: impl Serialize) -> Response {
    let location = format!("{}/{}", W::LIST, job.id());
    (StatusCode::ACCEPTED, [(header::LOCATION, location)], Json(view)).into_response()
}

/// A page of a tenant's jobs as `view` has them, and where the next one begins.
///
/// # Errors
/// `after` is not an id.
pub(super) fn page<W: Run, V>(
    service: &Service,
    tenant: &Tenant,
    Query(query): &Query<PageQuery>,
    view: impl Fn(&Job<W>) -> V,
) -> Result<(Vec<V>, Option<String>), ApiError> {
    let found = W::jobs(service).page(&tenant.name, query.after()?, PAGE + 1);
    let (page, next) = page_of(found, |job| job.id().to_owned());
    Ok((page.iter().map(|job| view(job)).collect(), next))
}

/// Deletes a job.
///
/// # Errors
/// Storage errors.
pub(super) async fn delete<W: Run>(service: &Arc<Service>, job: &Arc<Job<W>>) -> Result<StatusCode, ApiError> {
    service.delete_job(job).await?;
    Ok(StatusCode::NO_CONTENT)
}

/// Progress of a job as events; `look` says how it is, for who was told the event with this id last.
///
/// # Errors
/// Too many streams.
pub(super) fn events<W: Work>(
    service: Arc<Service>,
    tenant: &Tenant,
    job: Arc<Job<W>>,
    headers: &HeaderMap,
    look: impl Fn(&Job<W>, Option<&str>) -> ProgressEvent + Send + Sync + 'static,
) -> Result<Response, ApiError> {
    let place = service.stream(tenant)?;
    let (changes, deleted) = (job.changes(), job.deleted().clone());
    let look = Box::new(move |heard: Option<&str>| look(&job, heard));
    Ok(progress::stream(service, place, headers, ProgressSource { changes, deleted, look }))
}

/// A result, or these bytes of it, which never change.
///
/// # Errors
/// A job that is not completed, a result that it does not have, and storage errors.
pub(super) async fn result<W: Work>(
    service: &Service,
    tenant: &Tenant,
    job: &Arc<Job<W>>,
    bytes: Option<Range<u64>>,
    (name, media_type): (&str, &'static str),
    headers: &HeaderMap,
) -> Result<Response, ApiError> {
    let finished = job.finished()?;
    let files = W::files(&finished);
    let part = files.iter().find(|part| part.name == name);
    let part = part.ok_or_else(|| ApiError::new(problem::NOT_FOUND, W::MISSING))?;
    let (store, path) = (service.store.clone(), service.store.job_file(kind_of::<W>(), job.id(), name)?);
    let opened = blocking(move || store.open_file(&path)).await?;
    let opened = opened.map_err(|error| job.fail_if_damaged(&service.store, error))?;
    let room = Permit::empty(&service.download_memory, &tenant.name);
    let etag =
        bytes.as_ref().map_or(part.blake3.clone(), |range| format!("{}-{}-{}", part.blake3, range.start, range.end));
    let bytes = bytes.unwrap_or(0..part.bytes);
    let file = Immutable::of_file(opened, bytes, etag, media_type, room, !service.access.is_guarded());
    let mut response = file.respond_readable(headers).await;
    let disposition = HeaderValue::from_str(&format!("attachment; filename=\"{name}\""));
    response.headers_mut().extend(disposition.ok().map(|value| (CONTENT_DISPOSITION, value)));
    Ok(response)
}
