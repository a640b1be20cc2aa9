//! `GET …/handles` and `GET …/coordinates`: handle indices for uploading handle rows, and `Φ` for decoding on the client.

use super::extract::{Accept, RequestedSession};
use super::openapi;
use super::ranged::Immutable;
use super::waiting::{not_acceptable, prepared};
use crate::admission::Permit;
use crate::problem::ApiError;
use crate::service::Service;
use axum::Json;
use axum::extract::State;
use axum::response::{IntoResponse, Response};
use bytes::Bytes;
use http::{HeaderMap, HeaderValue, header};
use std::io;
use std::ops::Range;
use std::sync::Arc;

/// The handles: rows of the rest pose, as u32 little-endian, or as a JSON list.
#[utoipa::path(
    get, path = "/v1/sessions/{id}/handles", operation_id = "get_handles", tag = "results", params(openapi::Id),
    responses((status = 200, description = "The handles", content(
        (Vec<u8> = "application/octet-stream"), (Vec<u32> = "application/json"),
    ))),
)]
pub(crate) async fn handles(
    State(service): State<Arc<Service>>,
    RequestedSession { session, .. }: RequestedSession,
    accept: Accept,
) -> Result<Response, ApiError> {
    prepared(&service, &session).await?;
    let solver = service.solver(&session).await?;
    let handles = solver.solver.handles();
    let mut response = match accept {
        Accept::Json => Json(handles).into_response(),
        Accept::Anything | Accept::Binary => {
            let bytes: Vec<u8> = handles.iter().flat_map(|handle| handle.to_le_bytes()).collect();
            ([(header::CONTENT_TYPE, "application/octet-stream")], bytes).into_response()
        }
        _ => return Err(not_acceptable("application/octet-stream or application/json")),
    };
    response.headers_mut().insert(header::VARY, HeaderValue::from_static("accept"));
    Ok(response)
}

/// `Φ` as f32 little-endian, row-major, `Cager-Rows` × `Cager-Columns`. It never changes.
#[utoipa::path(
    get, path = "/v1/sessions/{id}/coordinates", operation_id = "get_coordinates", tag = "results", params(openapi::Id, openapi::Conditions),
    responses(
        (status = 200, description = "Φ", content_type = "application/octet-stream", body = Vec<u8>,
            headers(("Cager-Rows" = u32, description = "Points n"), ("Cager-Columns" = u32, description = "Values of a cage: its unknowns m, and its face normals where they follow from them"))),
        (status = 206, description = "The range asked for", content_type = "application/octet-stream", body = Vec<u8>),
        (status = 304, description = "The client's copy is current"),
    ),
)]
pub(crate) async fn get(
    State(service): State<Arc<Service>>,
    RequestedSession { session, tenant }: RequestedSession,
    headers: HeaderMap,
) -> Result<Response, ApiError> {
    let facts = prepared(&service, &session).await?;
    let prepared = service.solver(&session).await?;
    let columns = prepared.solver.decoder().columns();
    let read = move |range: Range<u64>| {
        let phi = prepared
            .solver
            .decoder()
            .coordinates()
            .ok_or_else(|| io::Error::other("a solver without its coordinates"))?;
        let stride = 4 * phi.ncols() as u64;
        let (begin, end) = (range.start / stride, range.end.div_ceil(stride));
        let mut bytes = Vec::with_capacity(((end - begin) * stride) as usize);
        for i in begin..end {
            for j in 0..phi.ncols() {
                bytes.extend_from_slice(&phi[(i as usize, j)].to_le_bytes());
            }
        }
        let from = (range.start - begin * stride) as usize;
        Ok(Bytes::from(bytes).slice(from..from + (range.end - range.start) as usize))
    };
    let coordinates = Immutable {
        length: 4 * u64::from(facts.points) * columns as u64,
        etag: format!("{}-phi", session.meta.key),
        media_type: "application/octet-stream",
        public: !service.access.is_guarded(),
        room: Permit::empty(&service.download_memory, &tenant.name),
        read: Arc::new(read),
    };
    let mut response = coordinates.respond(&headers);
    response.headers_mut().insert("cager-rows", HeaderValue::from(facts.points));
    response.headers_mut().insert("cager-columns", HeaderValue::from(columns));
    Ok(response)
}
