//! `/` and `/assets`: the viewer, which `make web` builds from `web/` and the program holds.

use super::ranged::is_known;
use crate::problem::{self, ApiError};
use axum::extract::Path;
use axum::response::{IntoResponse, Response};
use http::{HeaderMap, StatusCode, header};
use rust_embed::{Embed, EmbeddedFile};
use std::borrow::Cow;

/// What the page may load: its own files, and pictures and films that it made itself. `style` attributes that scripts set are not meant by it.
const POLICY: &str = "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob: data:; \
    connect-src 'self' blob:; worker-src 'self'; font-src 'self'; media-src 'self' blob:; base-uri 'none'; form-action 'none'; \
    frame-ancestors 'self'";
const NO_VIEWER: &str = include_str!("no_viewer.html");

/// Name of the component's script.
pub(super) const COMPONENT: &str = "cager-viewer.js";

#[derive(Embed)]
#[folder = "../../web/dist/viewer"]
#[allow_missing = true]
struct Files;

/// The page.
#[utoipa::path(
    get, path = "/", operation_id = "get_page", tag = "operation", security(()),
    responses((status = 200, description = "The page", content_type = "text/html", body = String)),
)]
pub(crate) async fn page(headers: HeaderMap) -> Response {
    match Files::get("index.html") {
        Some(file) => send(&headers, "index.html", file, "no-cache"),
        None => {
            ([(header::CONTENT_SECURITY_POLICY, POLICY), (header::CONTENT_TYPE, "text/html; charset=utf-8")], NO_VIEWER)
                .into_response()
        }
    }
}

/// The viewer as a component for other pages; it loads the files of the page.
pub(super) async fn component(headers: HeaderMap) -> Result<Response, ApiError> {
    found(&headers, COMPONENT, COMPONENT, "no-cache")
}

/// A file of the page, whose name has a hash of its content.
pub(super) async fn asset(Path(name): Path<String>, headers: HeaderMap) -> Result<Response, ApiError> {
    found(&headers, &format!("assets/{name}"), &name, "public, max-age=31536000, immutable")
}

fn found(request: &HeaderMap, path: &str, name: &str, cached: &'static str) -> Result<Response, ApiError> {
    match Files::get(path) {
        Some(file) => Ok(send(request, name, file, cached)),
        None => Err(ApiError::new(problem::NOT_FOUND, "the page has no such file; reload the page")),
    }
}

fn send(request: &HeaderMap, name: &str, file: EmbeddedFile, cached: &'static str) -> Response {
    let digest: String = file.metadata.sha256_hash()[..16].iter().map(|byte| format!("{byte:02x}")).collect();
    let digest = format!("\"{digest}\"");
    let headers = [
        // Weak, since the same tag goes with the compressed file.
        (header::ETAG, format!("W/{digest}")),
        (header::CACHE_CONTROL, cached.to_owned()),
        (header::CONTENT_SECURITY_POLICY, POLICY.to_owned()),
        (header::X_CONTENT_TYPE_OPTIONS, "nosniff".to_owned()),
        (header::REFERRER_POLICY, "no-referrer".to_owned()),
    ];
    if is_known(request, &digest) {
        return (StatusCode::NOT_MODIFIED, headers).into_response();
    }
    let data = match file.data {
        Cow::Borrowed(data) => bytes::Bytes::from_static(data),
        Cow::Owned(data) => data.into(),
    };
    (headers, [(header::CONTENT_TYPE, media_type(name))], data).into_response()
}

/// By the end of a file's name; the page has no others.
fn media_type(name: &str) -> &'static str {
    match name.rsplit_once('.').map_or("", |(_, end)| end) {
        "html" => "text/html; charset=utf-8",
        "js" => "text/javascript; charset=utf-8",
        "css" => "text/css; charset=utf-8",
        "svg" => "image/svg+xml",
        "json" => "application/json",
        _ => "application/octet-stream",
    }
}
