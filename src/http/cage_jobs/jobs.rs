//! Listing, looking at and deleting cage designs.

use crate::http::extract::{Caller, Query, Requested, RequestedCageJob};
use crate::http::openapi;
use crate::http::sessions::{PAGE, PageQuery};
use crate::problem::ApiError;
use crate::service::Service;
use axum::Json;
use axum::extract::State;
use cager_proto::cage_messages::{CageJob, CageJobList};
use http::StatusCode;
use std::sync::Arc;

/// Lists the tenant's cage designs, newest first, a hundred at a time.
#[utoipa::path(get, path = "/v1/cages", operation_id = "list_cage_designs", tag = "cages", params(PageQuery), responses((status = 200, description = "A page of designs", body = CageJobList)))]
pub(crate) async fn list(
    State(service): State<Arc<Service>>,
    Caller(tenant): Caller,
    Query(query): Query<PageQuery>,
) -> Json<CageJobList> {
    let mut page = service.cage_jobs.page(&tenant.name, query.after.as_deref(), PAGE + 1);
    let more = page.len() > PAGE;
    page.truncate(PAGE);
    let next = page.last().filter(|_| more).map(|job| job.meta.id.clone());
    Json(CageJobList { cages: page.iter().map(|job| job.view()).collect(), next })
}

/// A cage design.
#[utoipa::path(get, path = "/v1/cages/{id}", operation_id = "get_cage_design", tag = "cages", params(openapi::CageId), responses((status = 200, description = "The design", body = CageJob)))]
pub(crate) async fn get(RequestedCageJob { job, .. }: RequestedCageJob) -> Json<CageJob> {
    Json(job.view())
}

/// Deletes a cage design; one that runs stops within a second. Sessions that took its cage keep it.
#[utoipa::path(delete, path = "/v1/cages/{id}", operation_id = "delete_cage_design", tag = "cages", params(openapi::CageId), responses((status = 204, description = "It is gone")))]
pub(crate) async fn delete(
    State(service): State<Arc<Service>>,
    Requested(job): Requested<crate::cage_job::CageJob>,
) -> Result<StatusCode, ApiError> {
    service.delete_cage_job(&job).await?;
    Ok(StatusCode::NO_CONTENT)
}
