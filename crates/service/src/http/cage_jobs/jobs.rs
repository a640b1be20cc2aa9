//! Listing, looking at and deleting cage designs.

use crate::cage_job::{CageDesign, CageJob};
use crate::http::extract::{Caller, Query, Requested, RequestedJob};
use crate::http::respond::JsonResult;
use crate::http::sessions::PageQuery;
use crate::http::{jobs, openapi};
use crate::problem::ApiError;
use crate::service::Service;
use axum::Json;
use axum::extract::State;
use cager_proto::cage_messages::{CageJob as View, CageJobList};
use http::StatusCode;
use std::sync::Arc;

/// Lists the tenant's cage designs, newest first, a hundred at a time.
#[utoipa::path(get, path = "/v1/cages", operation_id = "list_cage_designs", tag = "cages", params(PageQuery), responses((status = 200, description = "A page of designs", body = CageJobList)))]
pub(crate) async fn list(
    State(service): State<Arc<Service>>,
    Caller(tenant): Caller,
    query: Query<PageQuery>,
) -> JsonResult<CageJobList> {
    let (cages, next) = jobs::page(&service, &tenant, &query, CageJob::view)?;
    Ok(Json(CageJobList { cages, next }))
}

/// A cage design.
#[utoipa::path(get, path = "/v1/cages/{id}", operation_id = "get_cage_design", tag = "cages", params(openapi::JobId), responses((status = 200, description = "The design", body = View)))]
pub(crate) async fn get(RequestedJob { job, .. }: RequestedJob<CageDesign>) -> Json<View> {
    Json(job.view())
}

/// Deletes a cage design; one that runs stops within a second. Sessions that took its cage keep it.
#[utoipa::path(delete, path = "/v1/cages/{id}", operation_id = "delete_cage_design", tag = "cages", params(openapi::JobId), responses((status = 204, description = "It is gone")))]
pub(crate) async fn delete(
    State(service): State<Arc<Service>>,
    Requested(job): Requested<CageJob>,
) -> Result<StatusCode, ApiError> {
    jobs::delete(&service, &job).await
}
