//! Listing, looking at, completing and deleting recoveries.

use crate::http::extract::{Body, Caller, Query, Requested, RequestedJob};
use crate::http::respond::JsonResult;
use crate::http::sessions::PageQuery;
use crate::http::{jobs, openapi};
use crate::problem::ApiError;
use crate::recovery::{Recovery, RecoveryJob};
use crate::service::Service;
use axum::Json;
use axum::extract::State;
use cager_proto::recovery_messages::{CompleteRecovery, Recovery as View, RecoveryList};
use http::StatusCode;
use std::sync::Arc;

/// Lists the tenant's recoveries, newest first, a hundred at a time.
#[utoipa::path(get, path = "/v1/recoveries", operation_id = "list_recoveries", tag = "recoveries", params(PageQuery), responses((status = 200, description = "A page of recoveries", body = RecoveryList)))]
pub(crate) async fn list(
    State(service): State<Arc<Service>>,
    Caller(tenant): Caller,
    query: Query<PageQuery>,
) -> JsonResult<RecoveryList> {
    let (recoveries, next) = jobs::page(&service, &tenant, &query, RecoveryJob::view)?;
    Ok(Json(RecoveryList { recoveries, next }))
}

/// A recovery.
#[utoipa::path(get, path = "/v1/recoveries/{id}", operation_id = "get_recovery", tag = "recoveries", params(openapi::JobId), responses((status = 200, description = "The recovery", body = View)))]
pub(crate) async fn get(RequestedJob { job, .. }: RequestedJob<Recovery>) -> Json<View> {
    Json(job.view())
}

/// Deletes a recovery with all that belongs to it; what runs for it stops.
#[utoipa::path(delete, path = "/v1/recoveries/{id}", operation_id = "delete_recovery", tag = "recoveries", params(openapi::JobId), responses((status = 204, description = "It is gone")))]
pub(crate) async fn delete(
    State(service): State<Arc<Service>>,
    Requested(job): Requested<RecoveryJob>,
) -> Result<StatusCode, ApiError> {
    jobs::delete(&service, &job).await
}

/// Says that no more frames are coming. The last ones are followed, a second pass goes back to the first, and the container is written, in the
/// background. Repeating it changes nothing.
#[utoipa::path(
    post, path = "/v1/recoveries/{id}/complete", operation_id = "complete_recovery", tag = "recoveries", params(openapi::JobId),
    request_body = CompleteRecovery, responses((status = 202, description = "The recovery, which is being finished", body = View)),
)]
pub(crate) async fn complete(
    State(service): State<Arc<Service>>,
    RequestedJob { job, .. }: RequestedJob<Recovery>,
    Body(CompleteRecovery { frames }): Body<CompleteRecovery>,
) -> Result<(StatusCode, Json<View>), ApiError> {
    service.complete_recovery(&job, frames).await?;
    Ok((StatusCode::ACCEPTED, Json(job.view())))
}
