//! `POST /v1/recoveries`: a template is to be followed.

use crate::http::extract::Caller;
use crate::http::jobs::accepted;
use crate::http::multipart::{self, Files};
use crate::http::openapi;
use crate::problem::ApiError;
use crate::recovery::NewRecovery;
use crate::service::Service;
use crate::store::RecoveryParts;
use axum::extract::{Request, State};
use axum::response::Response;
use cager_proto::recovery_messages::Recovery;
use std::sync::Arc;

/// Recovers one animation of a template from surfaces without correspondence: part `template` is a mesh, part `cage` a cage around it, or parts
/// `rig` and `manifold` what is known of a person; part `options` is JSON. Frames are then posted one by one or several at a time, and are followed in
/// the background, below all frames of sessions.
#[utoipa::path(
    post, path = "/v1/recoveries", operation_id = "create_recovery", tag = "recoveries",
    params(("Idempotency-Key" = Option<String>, Header, min_length = 1, max_length = 255, pattern = "^[ -~]+$", description = "A repetition with the same key and content gives the same recovery")),
    request_body(content = openapi::NewRecoveryForm, content_type = "multipart/form-data"),
    responses((status = 202, description = "The recovery, or the one that an earlier request with the same key made", body = Recovery,
        headers(("Location" = String, description = "Address of the recovery")))),
)]
pub(crate) async fn create(
    State(service): State<Arc<Service>>,
    Caller(tenant): Caller,
    request: Request,
) -> Result<Response, ApiError> {
    let words = ("template, cage or rig and manifold, and options", "template, cage, rig and manifold");
    let parts = ["template", "cage", "rig", "manifold"];
    let mut form = multipart::read_files(&service, &tenant, request, &parts, words).await?;
    let template = form.take("template", "the mesh that is to move")?;
    let [cage, rig, manifold] = ["cage", "rig", "manifold"].map(|part| form.files.remove(part));
    let parts = RecoveryParts { template, cage, rig, manifold };
    let Files { options, idempotency_key, room, .. } = form;
    let new = NewRecovery { parts, options, idempotency_key, room };
    let job = service.create_recovery(&tenant, new).await?;
    Ok(accepted(&job, job.view()))
}
