//! `/v1/shapespaces`: poses of one model, and the shapes between them.

use super::extract::{Caller, Query};
use super::job_frames::OCTETS;
use super::openapi;
use super::spooled::{self, FormParts, SpooledForm};
use crate::auth::Tenant;
use crate::idempotency::{create_once, fingerprint_of_files};
use crate::problem::{self, ApiError};
use crate::service::Service;
use crate::shape_spaces::{KeptSpace, Wanted, check_options};
use crate::store::{Idempotency, SOURCE};
use crate::tasks::{blocking, to_the_end};
use axum::Json;
use axum::extract::{FromRequestParts, Path, Request, State};
use axum::response::{IntoResponse, Response};
use cager_proto::shape_messages::{ShapeSpace, ShapeSpaceList, ShapeSpaceOptions};
use http::request::Parts;
use http::{StatusCode, header};
use serde::Deserialize;
use std::sync::Arc;

/// The tenant's shape space named in the path. Rejects with 404 if it does not exist or belongs to another tenant.
pub(crate) struct RequestedSpace(Arc<KeptSpace>);

impl FromRequestParts<Arc<Service>> for RequestedSpace {
    type Rejection = ApiError;

    async fn from_request_parts(parts: &mut Parts, service: &Arc<Service>) -> Result<Self, ApiError> {
        let Caller(tenant) = Caller::from_request_parts(parts, service).await?;
        let id = Path::<String>::from_request_parts(parts, service).await;
        let Path(id) = id.map_err(|_| ApiError::new(problem::NOT_FOUND, "the id of the shape space is missing"))?;
        service.shape_spaces.find(&tenant.name, &id).map(Self)
    }
}

/// Makes a shape space: parts `pose`, two or more, are meshes of the same points in the same order, the first with faces; or the frames `options.frames`
/// of a container, part `source`, or of a completed session, `options.source_session`. Part `cage` is a cage around the first pose or around the
/// container's model. It is kept in memory, and forgotten after a while without a request.
#[utoipa::path(
    post, path = "/v1/shapespaces", operation_id = "create_shape_space", tag = "shapespaces",
    params(("Idempotency-Key" = Option<String>, Header, min_length = 1, max_length = 255, pattern = "^[ -~]+$", description = "A repetition with the same key and content gives the same shape space")),
    request_body(content = openapi::NewShapeSpaceForm, content_type = "multipart/form-data"),
    responses((status = 201, description = "The shape space", body = ShapeSpace, headers(("Location" = String, description = "Address of the shape space")))),
)]
pub(crate) async fn create(
    State(service): State<Arc<Service>>,
    Caller(tenant): Caller,
    request: Request,
) -> Result<Response, ApiError> {
    let parts = FormParts {
        sent: "pose, two or more, or source, cage and options",
        files: &["cage"],
        many: Some("pose"),
        what: "poses and cage are",
        large: &[SOURCE],
        cure: "send the poses as meshes",
        check: &check_options,
    };
    let form = spooled::read(&service, &tenant, request, &parts).await?;
    let (form, request) = blocking(move || {
        let request = request_of(&form);
        (form, request)
    })
    .await?;
    let kept = to_the_end(async move {
        let (making, owner) = (Arc::clone(&service), Arc::clone(&tenant));
        create_once(&service.shape_spaces, &tenant.name, request, |request| make(making, owner, form, request)).await
    });
    let view = kept.await?.view.clone();
    let location = format!("/v1/shapespaces/{}", view.id);
    Ok((StatusCode::CREATED, [(header::LOCATION, location)], Json(view)).into_response())
}

/// The request with an idempotency key that this form is. Blocks.
fn request_of(form: &SpooledForm<ShapeSpaceOptions>) -> Option<Idempotency> {
    let files = form.many.iter().map(|file| ("pose", file)).chain(form.files.iter().map(|(part, file)| (*part, file)));
    let files = files.map(|(part, file)| (part, &file.name[..], blake3::hash(&file.bytes)));
    let large = form.large.iter().map(|large| (large.part, &large.name[..], large.spool.digest()));
    fingerprint_of_files(form.idempotency_key.clone(), files.chain(large), &form.options)
}

async fn make(
    service: Arc<Service>,
    tenant: Arc<Tenant>,
    form: SpooledForm<ShapeSpaceOptions>,
    request: Option<Idempotency>,
) -> Result<Arc<KeptSpace>, ApiError> {
    let session = match form.options.source_session.clone() {
        Some(id) => Some(service.completed_container(&tenant.name, &id).await?),
        None => None,
    };
    let place = service.parse_slots.take(&tenant.name, 1).await;
    blocking(move || {
        let (_place, threads) = (place, service.solvers.pool());
        threads.install(|| {
            let cage = form.files.get("cage");
            let source = form.large.as_ref().map(|large| large.spool.path()).or(session.as_deref());
            let sources = [form.large.is_some(), session.is_some(), !form.many.is_empty()];
            if sources.iter().filter(|there| **there).count() != 1 {
                let detail = "send the poses as parts pose, or one container as source, or name a session as options.source_session";
                return Err(ApiError::new(problem::BAD_REQUEST, detail));
            }
            let spaces = &service.shape_spaces;
            let wanted = Wanted { spaces, tenant: &tenant.name, options: &form.options, cage };
            let poses = match source {
                Some(path) => wanted.of_container(path)?,
                None => wanted.of_files(&form.many)?,
            };
            spaces.create(&tenant.name, form.options, poses, request)
        })
    })
    .await?
}

/// Lists the tenant's shape spaces, newest first.
#[utoipa::path(get, path = "/v1/shapespaces", operation_id = "list_shape_spaces", tag = "shapespaces", responses((status = 200, description = "The shape spaces", body = ShapeSpaceList)))]
pub(crate) async fn list(State(service): State<Arc<Service>>, Caller(tenant): Caller) -> Json<ShapeSpaceList> {
    Json(ShapeSpaceList { shapespaces: service.shape_spaces.of(&tenant.name) })
}

/// A shape space.
#[utoipa::path(get, path = "/v1/shapespaces/{id}", operation_id = "get_shape_space", tag = "shapespaces", params(openapi::JobId), responses((status = 200, description = "The shape space", body = ShapeSpace)))]
pub(crate) async fn get(RequestedSpace(kept): RequestedSpace) -> Json<ShapeSpace> {
    Json(kept.view.clone())
}

/// Forgets a shape space.
#[utoipa::path(delete, path = "/v1/shapespaces/{id}", operation_id = "delete_shape_space", tag = "shapespaces", params(openapi::JobId), responses((status = 204, description = "It is gone")))]
pub(crate) async fn delete(State(service): State<Arc<Service>>, RequestedSpace(kept): RequestedSpace) -> StatusCode {
    service.shape_spaces.remove(&kept.view.id);
    StatusCode::NO_CONTENT
}

/// Which shape.
#[derive(Debug, Deserialize, utoipa::IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub(crate) struct PoseQuery {
    /// A weight for each pose, with commas between them, which sum to 1; below 0 and above 1 they lead beyond the poses.
    #[param(example = "0.5,0.5")]
    weights: String,
    /// What is sent: the model, or the cage that it lies in.
    #[serde(default)]
    #[param(inline)]
    of: PoseOf,
}

#[derive(Clone, Copy, Debug, Default, Deserialize, PartialEq, Eq, utoipa::ToSchema)]
#[serde(rename_all = "lowercase")]
pub(crate) enum PoseOf {
    #[default]
    Model,
    Cage,
}

/// A shape between the poses, or beyond them: n × 3 little-endian f32.
#[utoipa::path(
    get, path = "/v1/shapespaces/{id}/pose", operation_id = "get_pose", tag = "shapespaces", params(openapi::JobId, PoseQuery),
    responses((status = 200, description = "The positions", content_type = "application/octet-stream", body = Vec<u8>),
        (status = 422, description = "Weights that name no shape", content_type = "application/problem+json", body = cager_proto::messages::Problem)),
)]
pub(crate) async fn pose(
    State(service): State<Arc<Service>>,
    RequestedSpace(kept): RequestedSpace,
    Query(PoseQuery { weights, of }): Query<PoseQuery>,
) -> Result<Response, ApiError> {
    let numbers: Result<Vec<f64>, _> = weights.split(',').map(|word| word.trim().parse()).collect();
    let numbers = numbers.map_err(|_| {
        let detail =
            format!("weights: {weights:?} is no list of numbers; give one for each pose, with commas between them");
        ApiError::new(problem::INVALID_OPTIONS, detail)
    })?;
    let threads = service.solvers.pool();
    let shape = blocking(move || threads.install(|| kept.shape(&numbers, of == PoseOf::Cage))).await??;
    let bytes: Vec<u8> = shape.as_flattened().iter().flat_map(|&x| (x as f32).to_le_bytes()).collect();
    Ok(([(header::CONTENT_TYPE, OCTETS), (header::CACHE_CONTROL, "no-store")], bytes).into_response())
}
