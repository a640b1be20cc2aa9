//! Forms with one large part, which is written to disk as it arrives, beside files that are kept in memory.

use super::form::Form;
use super::multipart::{FormHeader, NAME_CHARACTERS, bad, broken, check_form_header, file_name, read_options};
use super::waiting::too_slow;
use crate::admission::Permit;
use crate::auth::Tenant;
use crate::problem::{self, ApiError};
use crate::service::Service;
use crate::session::registry::Reserved;
use crate::store::{NamedFile, Spool};
use crate::tasks::blocking;
use axum::extract::Request;
use axum::extract::multipart::Field;
use bytes::BytesMut;
use serde::de::DeserializeOwned;
use std::collections::BTreeMap;
use std::sync::Arc;
use tokio::time::timeout;

/// Bytes written to disk at a time; quota is reserved in the same steps.
const SPOOL_CHUNK_BYTES: usize = 1 << 20;

/// A large part.
pub(crate) struct LargePart {
    /// Name of the part.
    pub(crate) part: &'static str,
    /// Name of its file.
    pub(crate) name: String,
    pub(crate) spool: Spool,
}

/// What such a form held.
pub(crate) struct SpooledForm<T> {
    pub(crate) files: BTreeMap<&'static str, NamedFile>,
    /// Files of the part that may be there several times, in their order.
    pub(crate) many: Vec<NamedFile>,
    pub(crate) large: Option<LargePart>,
    pub(crate) options: T,
    /// Permit for the memory of the files.
    pub(crate) room: Permit,
    /// Quota reserved for the large part.
    pub(crate) reserved: Reserved,
    pub(crate) idempotency_key: Option<String>,
    /// Among the tenant's streams, until the request is answered.
    pub(crate) place: Permit,
}

/// The parts that such a form may have beside `options`.
pub(super) struct FormParts<'a, T> {
    /// All of them, in words.
    pub(super) sent: &'a str,
    pub(super) files: &'a [&'static str],
    /// A part that may be there several times.
    pub(super) many: Option<&'static str>,
    /// The subject of the message for files that are too large.
    pub(super) what: &'a str,
    /// One of these.
    pub(super) large: &'a [&'static str],
    /// What to do about a large part that is too large.
    pub(super) cure: &'a str,
    /// Validates options before the large part arrives if they come first.
    pub(super) check: &'a (dyn Fn(&T) -> Result<(), ApiError> + Sync),
}

/// Reads all parts.
///
/// # Errors
/// Those of the form's headers; too many streams; parts that are twice there, unknown or too large; no room; a body that comes too slowly; storage errors.
pub(super) async fn read<T: DeserializeOwned + Default>(
    service: &Arc<Service>,
    tenant: &Arc<Tenant>,
    request: Request,
    parts: &FormParts<'_, T>,
) -> Result<SpooledForm<T>, ApiError> {
    let limit = service.config.max_frames_bytes.saturating_add(service.config.max_rest_bytes);
    let FormHeader { idempotency_key, patience } = check_form_header(service, &request, parts.sent, limit)?;
    let place = service.stream(tenant)?;
    let reading = async {
        let body = Form::of(request).await?;
        let room = Permit::empty(&service.upload_memory, &tenant.name);
        let reserved = service.reserve(tenant, 0)?;
        let mut receiver = Receiver { service, tenant, taken: 0, room, reserved };
        let read = receiver.read(body, parts).await?;
        Ok::<_, ApiError>((read, receiver.room, receiver.reserved))
    };
    let (read, room, reserved) = timeout(patience, reading).await.map_err(|_| too_slow())??;
    let Parts { files, many, large, options } = read;
    Ok(SpooledForm { files, many, large, options, room, reserved, idempotency_key, place })
}

struct Receiver<'a> {
    service: &'a Arc<Service>,
    tenant: &'a Arc<Tenant>,
    /// Bytes in memory.
    taken: u64,
    room: Permit,
    reserved: Reserved,
}

struct Parts<T> {
    files: BTreeMap<&'static str, NamedFile>,
    many: Vec<NamedFile>,
    large: Option<LargePart>,
    options: T,
}

impl Receiver<'_> {
    async fn read<T: DeserializeOwned + Default>(
        &mut self,
        mut body: Form,
        parts: &FormParts<'_, T>,
    ) -> Result<Parts<T>, ApiError> {
        let (mut files, mut many, mut large, mut options) = (BTreeMap::new(), Vec::new(), None::<LargePart>, None);
        while let Some(field) = body.next().await? {
            let part = field.name().unwrap_or_default().to_owned();
            let named = |names: &[&'static str]| names.iter().find(|name| **name == part).copied();
            let twice = || bad(format!("part {part:?} is there twice; send it once"));
            if part == "options" {
                if options.is_some() {
                    return Err(twice());
                }
                let request: T = read_options(field).await?;
                (parts.check)(&request)?;
                options = Some(request);
            } else if let Some(part) = named(parts.files) {
                if files.contains_key(part) {
                    return Err(twice());
                }
                files.insert(part, self.read_file(part, field, parts.what).await?);
            } else if parts.many == Some(part.as_str()) {
                many.push(self.read_file(&part, field, parts.what).await?);
            } else if let Some(part) = named(parts.large) {
                match &large {
                    Some(there) if there.part == part => return Err(twice()),
                    Some(there) => {
                        return Err(bad(format!("parts {:?} and {part:?} exclude each other; send one", there.part)));
                    }
                    None => large = Some(self.read_large(part, field, parts.cure).await?),
                }
            } else {
                let known: Vec<&str> = parts.many.iter().chain(parts.files).chain(parts.large).copied().collect();
                return Err(bad(format!("part {part:?} is unknown; send {} and options", known.join(", "))));
            }
        }
        Ok(Parts { files, many, large, options: options.unwrap_or_default() })
    }

    async fn read_file(&mut self, part: &str, mut field: Field<'_>, what: &str) -> Result<NamedFile, ApiError> {
        let name = file_name(&field);
        if !name.contains('.') || name.chars().count() > NAME_CHARACTERS {
            let detail = format!("part {part:?} needs a file name whose extension says the format, such as rest.obj");
            return Err(bad(detail));
        }
        let limit = self.service.config.max_rest_bytes;
        let mut bytes = Vec::new();
        while let Some(chunk) = field.chunk().await.map_err(|e| broken(&e))? {
            self.taken += chunk.len() as u64;
            if self.taken > limit {
                return Err(self.too_large(&format!("{what} larger than {limit} bytes; send a lighter model"), limit));
            }
            self.service.make_room(&mut self.room, self.taken)?;
            bytes.extend_from_slice(&chunk);
        }
        Ok(NamedFile { name, bytes })
    }

    async fn read_large(
        &mut self,
        part: &'static str,
        mut field: Field<'_>,
        cure: &str,
    ) -> Result<LargePart, ApiError> {
        let name = file_name(&field);
        if name.chars().count() > NAME_CHARACTERS {
            return Err(bad(format!("part {part:?} has a file name of more than {NAME_CHARACTERS} characters")));
        }
        let limit = self.service.config.max_frames_bytes;
        let store = self.service.store.clone();
        let mut spool = blocking(move || store.spool()).await??;
        let mut waiting = BytesMut::new();
        loop {
            let chunk = field.chunk().await.map_err(|e| broken(&e))?;
            let ended = chunk.is_none();
            waiting.extend_from_slice(&chunk.unwrap_or_default());
            if waiting.len() < SPOOL_CHUNK_BYTES && !ended {
                continue;
            }
            if spool.bytes() + waiting.len() as u64 > limit {
                let detail = format!("the part {part:?} has more than {limit} bytes; {cure}");
                return Err(self.too_large(&detail, limit));
            }
            self.service.reserve_more(self.tenant, &mut self.reserved, waiting.len() as u64)?;
            let piece = waiting.split().freeze();
            let written;
            (spool, written) = blocking(move || {
                let written = spool.append(&piece);
                (spool, written)
            })
            .await?;
            written?;
            if ended {
                return Ok(LargePart { part, name: if name.is_empty() { part.to_owned() } else { name }, spool });
            }
        }
    }

    fn too_large(&self, detail: &str, limit: u64) -> ApiError {
        self.service.rejected("body_too_large");
        ApiError::new(problem::TOO_LARGE, detail).limit(limit)
    }
}
