//! Listing, looking at, completing and deleting recoveries.

use crate::http::extract::{Body, Caller, Query, Requested, RequestedJob};
use crate::http::openapi;
use crate::http::sessions::PageQuery;
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
    Query(query): Query<PageQuery>,
) -> Json<RecoveryList> {
    let (page, next) = query.page(&service.recoveries, &tenant);
    Json(RecoveryList { recoveries: page.iter().map(|job| job.view()).collect(), next })
}

/// A recovery.
#[utoipa::path(get, path = "/v1/recoveries/{id}", operation_id = "get_recovery", tag = "recoveries", params(openapi::RecoveryId), responses((status = 200, description = "The recovery", body = View)))]
pub(crate) async fn get(RequestedJob { job, .. }: RequestedJob<Recovery>) -> Json<View> {
    Json(job.view())
}

/// Deletes a recovery with all that belongs to it; what runs for it stops.
#[utoipa::path(delete, path = "/v1/recoveries/{id}", operation_id = "delete_recovery", tag = "recoveries", params(openapi::RecoveryId), responses((status = 204, description = "It is gone")))]
pub(crate) async fn delete(
    State(service): State<Arc<Service>>,
    Requested(job): Requested<RecoveryJob>,
) -> Result<StatusCode, ApiError> {
    service.delete_job(&job).await?;
    Ok(StatusCode::NO_CONTENT)
}

/// Says that no more frames are coming. The last ones are followed, a second pass goes back to the first, and the container is written, in the
/// background. Repeating it changes nothing.
#[utoipa::path(
    post, path = "/v1/recoveries/{id}/complete", operation_id = "complete_recovery", tag = "recoveries", params(openapi::RecoveryId),
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
