//! `GET /v1/sessions/{id}/capture.abc`, `.glb` and `.usdc`: exports with an address of their own, for programs that know a format by the end of a name.

use super::exported::{Format, file};
use super::extract::RequestedSession;
use super::openapi;
use crate::problem::ApiError;
use crate::service::Service;
use axum::extract::State;
use axum::response::Response;
use http::HeaderMap;
use std::sync::Arc;

/// The frames of a completed session as Alembic: the export with `format=abc`.
#[utoipa::path(
    get, path = "/v1/sessions/{id}/capture.abc", operation_id = "get_capture_abc", tag = "results", params(openapi::Id, openapi::Conditions),
    responses(
        (status = 200, description = "The file", content_type = "application/octet-stream", body = Vec<u8>),
        (status = 206, description = "The range asked for", content_type = "application/octet-stream", body = Vec<u8>),
        (status = 304, description = "The client's copy is current"),
    ),
)]
pub(crate) async fn abc(
    State(service): State<Arc<Service>>,
    RequestedSession { session, tenant }: RequestedSession,
    headers: HeaderMap,
) -> Result<Response, ApiError> {
    file(&service, &session, &tenant, Format::Abc, &headers).await
}

/// The frames of a completed session as glTF with morph targets: the export with `format=glb`.
#[utoipa::path(
    get, path = "/v1/sessions/{id}/capture.glb", operation_id = "get_capture_glb", tag = "results", params(openapi::Id, openapi::Conditions),
    responses(
        (status = 200, description = "The file", content_type = "model/gltf-binary", body = Vec<u8>),
        (status = 206, description = "The range asked for", content_type = "model/gltf-binary", body = Vec<u8>),
        (status = 304, description = "The client's copy is current"),
    ),
)]
pub(crate) async fn glb(
    State(service): State<Arc<Service>>,
    RequestedSession { session, tenant }: RequestedSession,
    headers: HeaderMap,
) -> Result<Response, ApiError> {
    file(&service, &session, &tenant, Format::Glb, &headers).await
}

/// The frames of a completed session as USD: the export with `format=usdc`.
#[utoipa::path(
    get, path = "/v1/sessions/{id}/capture.usdc", operation_id = "get_capture_usdc", tag = "results", params(openapi::Id, openapi::Conditions),
    responses(
        (status = 200, description = "The file", content_type = "model/vnd.usd", body = Vec<u8>),
        (status = 206, description = "The range asked for", content_type = "model/vnd.usd", body = Vec<u8>),
        (status = 304, description = "The client's copy is current"),
    ),
)]
pub(crate) async fn usdc(
    State(service): State<Arc<Service>>,
    RequestedSession { session, tenant }: RequestedSession,
    headers: HeaderMap,
) -> Result<Response, ApiError> {
    file(&service, &session, &tenant, Format::Usdc, &headers).await
}
