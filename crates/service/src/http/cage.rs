//! `GET …/cage`: the rest cage, which decoders need where a cage's normals follow from its vertices.

use super::extract::{Accept, RequestedSession};
use super::openapi;
use super::waiting::{not_acceptable, prepared};
use crate::problem::ApiError;
use crate::service::Service;
use crate::tasks::blocking;
use axum::Json;
use axum::extract::State;
use axum::response::{IntoResponse, Response};
use cager_proto::messages::RestCage;
use http::{HeaderValue, header};
use std::sync::Arc;

/// The cage in its rest pose, as it is used: triangles, counter-clockwise seen from outside. Little-endian: three f64 for each
/// vertex (`Cager-Vertices`), then three u32 for each face (`Cager-Faces`); or JSON. It never changes.
#[utoipa::path(
    get, path = "/v1/sessions/{id}/cage", operation_id = "get_cage", tag = "results", params(openapi::Id),
    responses((status = 200, description = "The rest cage",
        content((Vec<u8> = "application/octet-stream"), (RestCage = "application/json")),
        headers(("Cager-Vertices" = u32, description = "Vertices v"), ("Cager-Faces" = u32, description = "Faces f")),
    )),
)]
pub(crate) async fn get(
    State(service): State<Arc<Service>>,
    RequestedSession { session, .. }: RequestedSession,
    accept: Accept,
) -> Result<Response, ApiError> {
    prepared(&service, &session).await?;
    let reading = Arc::clone(&session);
    let cage = {
        let place = service.parse_slots.take(&session.meta.tenant, 1).await;
        blocking(move || {
            let _place = place;
            reading.rest_cage()
        })
        .await??
    };
    let (vertices, faces) = (cage.vertices().to_vec(), cage.mesh().triangles.clone());
    let counts = [vertices.len(), faces.len()];
    let mut response = match accept {
        Accept::Json => Json(RestCage { vertices, faces }).into_response(),
        Accept::Anything | Accept::Binary => {
            let numbers = vertices.iter().flatten().flat_map(|x| x.to_le_bytes());
            let bytes: Vec<u8> = numbers.chain(faces.iter().flatten().flat_map(|v| v.to_le_bytes())).collect();
            ([(header::CONTENT_TYPE, "application/octet-stream")], bytes).into_response()
        }
        _ => return Err(not_acceptable("application/octet-stream or application/json")),
    };
    response.headers_mut().insert(header::VARY, HeaderValue::from_static("accept"));
    for (name, count) in ["cager-vertices", "cager-faces"].into_iter().zip(counts) {
        response.headers_mut().insert(name, HeaderValue::from(count));
    }
    Ok(response)
}
