//! `POST /v1/cages`: a cage is to be designed.

use super::parts;
use crate::http::extract::Caller;
use crate::http::frames::too_slow;
use crate::http::multipart::{self, FormHeader};
use crate::http::openapi;
use crate::problem::ApiError;
use crate::service::Service;
use axum::Json;
use axum::extract::{Request, State};
use axum::response::{IntoResponse, Response};
use cager_proto::cage_messages::CageJob;
use http::{StatusCode, header};
use std::sync::Arc;
use tokio::time::timeout;

/// Designs a cage by example: part `rest` is the rest pose, part `frames` frames of its motion, part `options` JSON. The design runs in the
/// background, below all frames of sessions; a session takes its cage by `options.cage.id`. The same files and options again are
/// answered from the completed design.
#[utoipa::path(
    post, path = "/v1/cages", operation_id = "design_cage", tag = "cages",
    params(("Idempotency-Key" = Option<String>, Header, min_length = 1, max_length = 255, pattern = "^[ -~]+$", description = "A repetition with the same key and content gives the same design")),
    request_body(content = openapi::NewCageForm, content_type = "multipart/form-data"),
    responses((status = 202, description = "The design, or the one that an earlier request with the same key made", body = CageJob,
        headers(("Location" = String, description = "Address of the design")))),
)]
pub(crate) async fn create(
    State(service): State<Arc<Service>>,
    Caller(tenant): Caller,
    request: Request,
) -> Result<Response, ApiError> {
    let limit = service.config.max_frames_bytes.saturating_add(service.config.max_rest_bytes);
    let form = multipart::check_form_header(&service, &request, "rest, frames and options", limit)?;
    let FormHeader { idempotency_key, patience } = form;
    let _place = service.stream(&tenant)?;
    let reading = parts::read(&service, &tenant, request, idempotency_key);
    let new = timeout(patience, reading).await.map_err(|_| too_slow())??;
    let job = service.create_cage_job(&tenant, new).await?;
    let location = format!("/v1/cages/{}", job.meta.id);
    Ok((StatusCode::ACCEPTED, [(header::LOCATION, location)], Json(job.view())).into_response())
}
