//! `GET /v1/cages/{id}/cage.obj`: the best cage so far, and in the end the result.

use crate::admission::Permit;
use crate::cage_job::{Cage, CageDesign};
use crate::http::extract::RequestedJob;
use crate::http::openapi;
use crate::http::ranged::Immutable;
use crate::problem::ApiError;
use crate::service::Service;
use crate::tasks::blocking;
use axum::extract::State;
use axum::response::Response;
use bytes::Bytes;
use http::header::{CACHE_CONTROL, CONTENT_DISPOSITION};
use http::{HeaderMap, HeaderValue};
use std::sync::Arc;

/// The best cage so far, as an OBJ file. Its `ETag` changes with the cage; once the design is completed, it never changes.
#[utoipa::path(
    get, path = "/v1/cages/{id}/cage.obj", operation_id = "get_designed_cage", tag = "cages", params(openapi::JobId, openapi::Conditions),
    responses(
        (status = 200, description = "The cage", content_type = "model/obj", body = String),
        (status = 206, description = "The range asked for", content_type = "model/obj", body = String),
        (status = 304, description = "The client's copy is current"),
    ),
)]
pub(crate) async fn get(
    State(service): State<Arc<Service>>,
    RequestedJob { job, tenant }: RequestedJob<CageDesign>,
    headers: HeaderMap,
) -> Result<Response, ApiError> {
    let store = service.store.clone();
    let cage = blocking(move || job.cage(&store)).await??;
    let is_final = matches!(cage, Cage::Final { .. });
    let (Cage::SoFar { obj, digest } | Cage::Final { obj, digest }) = cage;
    let bytes = Immutable {
        length: obj.len() as u64,
        etag: digest,
        media_type: "model/obj",
        public: !service.access.is_guarded(),
        room: Permit::empty(&service.download_memory, &tenant.name),
        read: Arc::new(move |range| Ok(Bytes::slice(&obj, range.start as usize..range.end as usize))),
    };
    let mut response = bytes.respond(&headers);
    if !is_final {
        response.headers_mut().insert(CACHE_CONTROL, HeaderValue::from_static("no-cache"));
    }
    let name = HeaderValue::from_static("attachment; filename=\"cage.obj\"");
    response.headers_mut().insert(CONTENT_DISPOSITION, name);
    Ok(response)
}
