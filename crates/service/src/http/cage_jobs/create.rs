//! `POST /v1/cages`: a cage is to be designed.

use crate::admission::Permit;
use crate::auth::Tenant;
use crate::cage_job::create::{NewCageJob, check_options};
use crate::http::extract::Caller;
use crate::http::jobs::accepted;
use crate::http::multipart::bad;
use crate::http::openapi;
use crate::http::spooled::{self, FormParts};
use crate::problem::ApiError;
use crate::service::Service;
use axum::extract::{Request, State};
use axum::response::Response;
use cager_proto::cage_messages::CageJob;
use std::sync::Arc;

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
    let (new, _place) = read(&service, &tenant, request).await?;
    let job = service.create_cage_job(&tenant, new).await?;
    Ok(accepted(&job, job.view()))
}

/// Reads the form that asks for a cage; with a place among the tenant's streams.
pub(crate) async fn read(
    service: &Arc<Service>,
    tenant: &Arc<Tenant>,
    request: Request,
) -> Result<(NewCageJob, Permit), ApiError> {
    let parts = FormParts {
        sent: "rest, frames and options",
        files: &["rest"],
        many: None,
        what: "the rest pose is",
        large: &["frames"],
        cure: "send every second or fewer, a design looks at 160 at most",
        check: &|options| check_options(options, &service.config),
    };
    let mut form = spooled::read(service, tenant, request, &parts).await?;
    let rest = form.files.remove("rest");
    let rest = rest.ok_or_else(|| bad("part rest is missing; send the rest pose as a file".to_owned()))?;
    let frames = form.large.ok_or_else(|| {
        bad("part frames is missing; send frames as .npy or raw f32, or make a cage from the rest pose alone by POST /v1/sessions".to_owned())
    })?;
    let new = NewCageJob {
        rest_name: rest.name,
        rest: rest.bytes,
        frames_name: frames.name,
        frames: frames.spool,
        options: form.options,
        idempotency_key: form.idempotency_key,
        room: form.room,
        reserved: form.reserved,
    };
    Ok((new, form.place))
}
