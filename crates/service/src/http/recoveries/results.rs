//! Results of a completed recovery: the container, joints and the report, files that never change.

use crate::http::extract::RequestedJob;
use crate::http::{jobs, openapi};
use crate::problem::ApiError;
use crate::recovery::Recovery;
use crate::service::Service;
use axum::extract::State;
use axum::response::Response;
use http::HeaderMap;
use std::sync::Arc;

/// The container of a completed recovery, byte for byte what `cager recover` writes for the same files and options.
#[utoipa::path(
    get, path = "/v1/recoveries/{id}/capture.cager", operation_id = "get_recovered_container", tag = "recoveries",
    params(openapi::JobId, openapi::Conditions),
    responses(
        (status = 200, description = "The container", content_type = "application/vnd.cager", body = Vec<u8>),
        (status = 206, description = "The range asked for", content_type = "application/vnd.cager", body = Vec<u8>),
        (status = 304, description = "The client's copy is current"),
    ),
)]
pub(crate) async fn container(
    State(service): State<Arc<Service>>,
    RequestedJob { job, tenant }: RequestedJob<Recovery>,
    headers: HeaderMap,
) -> Result<Response, ApiError> {
    jobs::result(&service, &tenant, &job, None, ("capture.cager", "application/vnd.cager"), &headers).await
}

/// How each frame was found and how far it lies from its surface, as `cager recover --report` writes it.
#[utoipa::path(
    get, path = "/v1/recoveries/{id}/report", operation_id = "get_recovery_report", tag = "recoveries",
    params(openapi::JobId, openapi::Conditions),
    responses(
        (status = 200, description = "The report", content_type = "application/json", body = Object),
        (status = 206, description = "The range asked for", content_type = "application/json", body = Object),
        (status = 304, description = "The client's copy is current"),
    ),
)]
pub(crate) async fn report(
    State(service): State<Arc<Service>>,
    RequestedJob { job, tenant }: RequestedJob<Recovery>,
    headers: HeaderMap,
) -> Result<Response, ApiError> {
    jobs::result(&service, &tenant, &job, None, ("report.json", "application/json"), &headers).await
}

/// Where the rig's joints are in every frame, `frame,joint,x,y,z`.
#[utoipa::path(
    get, path = "/v1/recoveries/{id}/joints.csv", operation_id = "get_joints_csv", tag = "recoveries",
    params(openapi::JobId, openapi::Conditions),
    responses(
        (status = 200, description = "The joints", content_type = "text/csv", body = String),
        (status = 206, description = "The range asked for", content_type = "text/csv", body = String),
        (status = 304, description = "The client's copy is current"),
    ),
)]
pub(crate) async fn joints_csv(
    State(service): State<Arc<Service>>,
    RequestedJob { job, tenant }: RequestedJob<Recovery>,
    headers: HeaderMap,
) -> Result<Response, ApiError> {
    jobs::result(&service, &tenant, &job, None, ("joints.csv", "text/csv"), &headers).await
}

/// The rig's joints in every frame as a skeleton in motion.
#[utoipa::path(
    get, path = "/v1/recoveries/{id}/joints.bvh", operation_id = "get_joints_bvh", tag = "recoveries",
    params(openapi::JobId, openapi::Conditions),
    responses(
        (status = 200, description = "The joints", content_type = "text/plain", body = String),
        (status = 206, description = "The range asked for", content_type = "text/plain", body = String),
        (status = 304, description = "The client's copy is current"),
    ),
)]
pub(crate) async fn joints_bvh(
    State(service): State<Arc<Service>>,
    RequestedJob { job, tenant }: RequestedJob<Recovery>,
    headers: HeaderMap,
) -> Result<Response, ApiError> {
    jobs::result(&service, &tenant, &job, None, ("joints.bvh", "text/plain"), &headers).await
}
