//! `POST /v1/cages`: a cage is to be designed.

use super::parts;
use crate::http::extract::{Caller, content_type, idempotency_key};
use crate::http::frames::{SLOWEST_BYTES_PER_SECOND, too_slow};
use crate::http::openapi;
use crate::problem::{self, ApiError};
use crate::service::Service;
use axum::Json;
use axum::extract::{Request, State};
use axum::response::{IntoResponse, Response};
use cager_proto::cage_messages::CageJob;
use http::{StatusCode, header};
use std::sync::Arc;
use std::time::Duration;
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
    let headers = request.headers();
    if content_type(headers).as_deref() != Some("multipart/form-data") {
        let detail = "send multipart/form-data with the parts rest, frames and options";
        return Err(ApiError::new(problem::MEDIA_TYPE, detail));
    }
    let limit = service.config.max_frames_bytes.saturating_add(service.config.max_rest_bytes);
    let declared = http_body::Body::size_hint(request.body()).lower();
    if declared > limit.saturating_add(crate::config::ENVELOPE_BYTES) {
        service.rejected("body_too_large");
        let detail = format!(
            "the body has {declared} bytes, but rest pose and frames may have {limit} together; send fewer frames"
        );
        return Err(ApiError::new(problem::TOO_LARGE, detail).limit(limit));
    }
    let idempotency_key = idempotency_key(headers)?;
    let _place = service.stream(&tenant)?;
    let most = if declared > 0 { declared } else { limit };
    let patience = Duration::from_secs(service.config.body_timeout_s + most / SLOWEST_BYTES_PER_SECOND);
    let reading = parts::read(&service, &tenant, request, idempotency_key);
    let new = timeout(patience, reading).await.map_err(|_| too_slow())??;
    let job = service.create_cage_job(&tenant, new).await?;
    let location = format!("/v1/cages/{}", job.meta.id);
    Ok((StatusCode::ACCEPTED, [(header::LOCATION, location)], Json(job.view())).into_response())
}
