//! `POST /v1/transfers`: a motion is to be moved.

use crate::http::extract::Caller;
use crate::http::jobs::accepted;
use crate::http::openapi;
use crate::http::spooled::{self, FormParts};
use crate::problem::ApiError;
use crate::service::Service;
use crate::store::{PAIRS, SOURCE, SOURCE_FRAMES};
use crate::transfers::{NewTransfer, check_options};
use axum::extract::{Request, State};
use axum::response::Response;
use cager_proto::transfer_messages::Transfer;
use std::sync::Arc;

/// Moves the motion of one model onto another that shares nothing with it: parts `source_rest` and `source_frames` are the source, or part `source` a
/// container, or `options.source_session` a completed session; part `target` is the model that is to move, part `cage` a cage of yours, part
/// `pairs` what corresponds, where you know some of it, part `options` JSON. It runs in the background, below all frames of sessions.
#[utoipa::path(
    post, path = "/v1/transfers", operation_id = "create_transfer", tag = "transfers",
    params(("Idempotency-Key" = Option<String>, Header, min_length = 1, max_length = 255, pattern = "^[ -~]+$", description = "A repetition with the same key and content gives the same transfer")),
    request_body(content = openapi::NewTransferForm, content_type = "multipart/form-data"),
    responses((status = 202, description = "The transfer, or the one that an earlier request with the same key made", body = Transfer,
        headers(("Location" = String, description = "Address of the transfer")))),
)]
pub(crate) async fn create(
    State(service): State<Arc<Service>>,
    Caller(tenant): Caller,
    request: Request,
) -> Result<Response, ApiError> {
    let parts = FormParts {
        sent: "source_rest and source_frames or source, target, cage, pairs and options",
        files: &["source_rest", "target", "cage", PAIRS],
        many: None,
        what: "source, target and cage at rest, and pairs, are",
        large: &[SOURCE_FRAMES, SOURCE],
        cure: "make a transfer for each part of the motion",
        check: &check_options,
    };
    let form = spooled::read(&service, &tenant, request, &parts).await?;
    let new = NewTransfer {
        files: form.files,
        large: form.large.map(|large| (large.part, large.name, large.spool)),
        options: form.options,
        idempotency_key: form.idempotency_key,
        room: form.room,
        reserved: form.reserved,
    };
    let job = service.create_transfer(&tenant, new).await?;
    Ok(accepted(&job, job.view()))
}
