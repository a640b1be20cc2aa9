//! Parses multipart bodies: the files that a session or a recovery is made from.

use super::extract::{content_type, idempotency_key};
use super::form::Form;
use super::metered::Metered;
use super::waiting::{SLOWEST_BYTES_PER_SECOND, body_error, too_slow};
use crate::admission::Permit;
use crate::auth::Tenant;
use crate::config::MULTIPART_OVERHEAD_BYTES;
use crate::problem::{self, ApiError};
use crate::service::Service;
use crate::store::NamedFile;
use axum::extract::Request;
use axum::extract::multipart::{Field, MultipartError};
use cager_proto::object::Object;
use serde::de::DeserializeOwned;
use std::collections::HashMap;
use std::sync::Arc;
use std::time::Duration;
use tokio::time::timeout;

const OPTIONS_BYTES: usize = 64 << 10;
pub(super) const NAME_CHARACTERS: usize = 200;
/// Name of the part with the matrix of the regularizer `matrix`.
pub(super) const MATRIX: &str = "regularizer_matrix";

/// What the headers of a form say.
pub(super) struct FormHeader {
    pub(super) idempotency_key: Option<String>,
    /// Longest time for the body to arrive.
    pub(super) patience: Duration,
}

/// Checks the headers of a form with these parts, whose content may have `limit` bytes.
///
/// # Errors
/// The body is not multipart, it is too large, or its idempotency key is malformed.
pub(super) fn check_form_header(
    service: &Service,
    request: &Request,
    parts: &str,
    limit: u64,
) -> Result<FormHeader, ApiError> {
    let headers = request.headers();
    if content_type(headers).as_deref() != Some("multipart/form-data") {
        return Err(ApiError::new(problem::MEDIA_TYPE, format!("send multipart/form-data with the parts {parts}")));
    }
    let declared = http_body::Body::size_hint(request.body()).lower();
    if declared > limit.saturating_add(MULTIPART_OVERHEAD_BYTES) {
        service.rejected("body_too_large");
        let detail = format!("the body has {declared} bytes, but the parts {parts} may have {limit} together");
        return Err(ApiError::new(problem::TOO_LARGE, detail).limit(limit));
    }
    let most = if declared > 0 { declared } else { limit };
    let patience = Duration::from_secs(service.config.body_timeout_s + most / SLOWEST_BYTES_PER_SECOND);
    Ok(FormHeader { idempotency_key: idempotency_key(headers)?, patience })
}

/// Files of a form by the names of their parts, and its options.
pub(super) struct Files<T> {
    pub(super) files: HashMap<&'static str, NamedFile>,
    pub(super) options: T,
    pub(super) idempotency_key: Option<String>,
    /// Permit for their memory.
    pub(super) room: Permit,
}

impl<T> Files<T> {
    /// The file of a part that has to be there.
    ///
    /// # Errors
    /// It is not there.
    pub(super) fn take(&mut self, part: &str, what: &str) -> Result<NamedFile, ApiError> {
        let missing = || bad(format!("part {part} is missing; send {what} as a file"));
        self.files.remove(part).ok_or_else(missing)
    }
}

/// Reads files into memory, and options; `sent` names all parts, `what` are all the files together.
///
/// # Errors
/// As [`check_form_header`]; parts that are twice there, unknown or too large; no room; a body that comes too slowly.
pub(super) async fn read_files<T: DeserializeOwned + Default>(
    service: &Arc<Service>,
    tenant: &Tenant,
    request: Request,
    parts: &[&'static str],
    (sent, what): (&str, &str),
) -> Result<Files<T>, ApiError> {
    let header = check_form_header(service, &request, sent, service.config.max_rest_bytes)?;
    let reading = async {
        let (metered, request) = Metered::new(service, tenant, request, format!("{what} have"));
        let body = Form::of(request).await?;
        metered.finish(read_parts(service, body, parts, what).await)
    };
    let ((files, options), room) = timeout(header.patience, reading).await.map_err(|_| too_slow())??;
    Ok(Files { files, options, idempotency_key: header.idempotency_key, room })
}

async fn read_parts<T: DeserializeOwned + Default>(
    service: &Service,
    mut body: Form,
    parts: &[&'static str],
    what: &str,
) -> Result<(HashMap<&'static str, NamedFile>, T), ApiError> {
    let (mut files, mut options) = (HashMap::new(), None);
    let mut left = service.config.max_rest_bytes;
    while let Some(field) = body.next().await? {
        let part = field.name().unwrap_or_default().to_owned();
        let twice = || bad(format!("part {part:?} is there twice; send it once"));
        if part == "options" {
            if options.is_some() {
                return Err(twice());
            }
            options = Some(read_options(field).await?);
        } else if let Some(known) = parts.iter().find(|known| **known == part) {
            if files.contains_key(known) {
                return Err(twice());
            }
            files.insert(*known, read_file(service, &part, field, &mut left, what).await?);
        } else {
            return Err(bad(format!("part {part:?} is unknown; send {} and options", parts.join(", "))));
        }
    }
    Ok((files, options.unwrap_or_default()))
}

async fn read_file(
    service: &Service,
    part: &str,
    mut field: Field<'_>,
    left: &mut u64,
    what: &str,
) -> Result<NamedFile, ApiError> {
    let name = file_name(&field);
    // There is one format of matrices, so that their names say nothing.
    let name = if part == MATRIX && name.is_empty() { format!("{MATRIX}.mtx") } else { name };
    if !(name.contains('.') || part == MATRIX) || name.chars().count() > NAME_CHARACTERS {
        let detail = format!("part {part:?} needs a file name whose extension says the format, such as rest.obj");
        return Err(bad(detail));
    }
    let mut bytes = Vec::new();
    while let Some(chunk) = field.chunk().await.map_err(|e| broken(&e))? {
        *left = left.checked_sub(chunk.len() as u64).ok_or_else(|| {
            service.rejected("body_too_large");
            let limit = service.config.max_rest_bytes;
            let detail = format!("{what} are larger than {limit} bytes together; send a lighter model");
            ApiError::new(problem::TOO_LARGE, detail).limit(limit)
        })?;
        bytes.extend_from_slice(&chunk);
    }
    Ok(NamedFile { name, bytes })
}

/// The file name of a part, without folders and control characters.
pub(super) fn file_name(field: &Field<'_>) -> String {
    let name = field.file_name().unwrap_or_default();
    name.rsplit(['/', '\\']).next().unwrap_or_default().chars().filter(|c| !c.is_control()).collect()
}

/// Parses a part as JSON.
///
/// # Errors
/// More than 64 KiB; invalid JSON or options.
pub(super) async fn read_options<T: DeserializeOwned>(mut field: Field<'_>) -> Result<T, ApiError> {
    let mut bytes = Vec::new();
    while let Some(chunk) = field.chunk().await.map_err(|e| broken(&e))? {
        bytes.extend_from_slice(&chunk);
        if bytes.len() > OPTIONS_BYTES {
            let detail = format!("part \"options\" is larger than {OPTIONS_BYTES} bytes");
            return Err(ApiError::new(problem::TOO_LARGE, detail).limit(OPTIONS_BYTES as u64));
        }
    }
    serde_json::from_slice(&bytes)
        .map(|Object(options)| options)
        .map_err(|error| ApiError::new(problem::INVALID_OPTIONS, format!("part \"options\": {error}")))
}

pub(super) fn bad(detail: String) -> ApiError {
    ApiError::new(problem::BAD_REQUEST, detail)
}

pub(super) fn broken(error: &MultipartError) -> ApiError {
    let general = body_error(error);
    if general.problem.word() != problem::BAD_REQUEST.word {
        return general;
    }
    bad(format!("the multipart body cannot be read: {}", error.body_text()))
}
