//! `GET /v1/sessions/{id}/capture.cager`: the container.

use super::extract::RequestedSession;
use super::openapi;
use super::ranged::Immutable;
use crate::problem::{self, ApiError};
use crate::service::Service;
use crate::session::Phase;
use crate::session::create::blocking;
use crate::store::StoreError;
use axum::extract::State;
use axum::response::Response;
use bytes::Bytes;
use http::header::CONTENT_DISPOSITION;
use http::{HeaderMap, HeaderValue};
use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom};
use std::ops::Range;
use std::sync::{Arc, Mutex, PoisonError};

/// The container of a completed session.
#[utoipa::path(
    get, path = "/v1/sessions/{id}/capture.cager", operation_id = "get_container", tag = "results", params(openapi::Id, openapi::Conditions),
    responses(
        (status = 200, description = "The container", content_type = "application/vnd.cager", body = Vec<u8>),
        (status = 206, description = "The range asked for", content_type = "application/vnd.cager", body = Vec<u8>),
        (status = 304, description = "The client's copy is current"),
    ),
)]
pub(crate) async fn get(
    State(service): State<Arc<Service>>,
    RequestedSession { session, tenant }: RequestedSession,
    headers: HeaderMap,
) -> Result<Response, ApiError> {
    let Phase::Completed(completion) = session.status().phase else {
        let detail = "the container is written when the session is completed; post {\"frames\": F} to complete";
        return Err(ApiError::new(problem::NOT_COMPLETED, detail));
    };
    let path = service.store.container_path(&session.meta.id);
    let opened = blocking(move || File::open(&path).map_err(|error| StoreError::of(&path, "open", error))).await?;
    let file = Mutex::new(opened.map_err(|error| session.storage_error(&error))?);
    let read = move |range: Range<u64>| -> io::Result<Bytes> {
        let mut file = file.lock().unwrap_or_else(PoisonError::into_inner);
        let mut bytes = vec![0; (range.end - range.start) as usize];
        file.seek(SeekFrom::Start(range.start))?;
        file.read_exact(&mut bytes)?;
        Ok(bytes.into())
    };
    let container = Immutable {
        length: completion.container_bytes,
        etag: completion.container_digest,
        media_type: "application/vnd.cager",
        public: !service.access.is_guarded(),
        room: service.download_memory.nothing(&tenant.name),
        read: Arc::new(read),
    };
    let mut response = container.respond(&headers);
    let name = HeaderValue::from_static("attachment; filename=\"capture.cager\"");
    response.headers_mut().insert(CONTENT_DISPOSITION, name);
    Ok(response)
}
