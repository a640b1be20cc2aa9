//! Parses the multipart body of a cage design: the rest pose into memory, the frames onto disk as they arrive.

use crate::admission::Held;
use crate::auth::Tenant;
use crate::cage_job::create::{NewCageJob, check_options};
use crate::http::multipart::{NAME_CHARACTERS, bad, broken, file_name, form, read_options};
use crate::http::paced::Paced;
use crate::problem::{self, ApiError};
use crate::service::Service;
use crate::session::registry::Reserved;
use crate::store::Spool;
use crate::tasks::blocking;
use axum::extract::multipart::Field;
use axum::extract::{Multipart, Request};
use bytes::BytesMut;
use cager_proto::cage_messages::CageOptions;
use std::sync::Arc;

/// Bytes of frames written to disk at a time; quota is reserved in the same steps.
const SPOOL_CHUNK_BYTES: usize = 1 << 20;

/// Reads all parts.
///
/// # Errors
/// Parts that are missing, twice there, unknown or too large; no room; storage errors.
pub(in crate::http) async fn read(
    service: &Arc<Service>,
    tenant: &Arc<Tenant>,
    request: Request,
    idempotency_key: Option<String>,
) -> Result<NewCageJob, ApiError> {
    let (pace, request) = Paced::new(request);
    let body = form(request).await?;
    let receiver = Receiver {
        service,
        tenant,
        pace: pace.clone(),
        room: service.upload_memory.nothing(&tenant.name),
        reserved: service.reserve(tenant, 0)?,
    };
    let read = receiver.read(body, idempotency_key).await;
    pace.finish(read)
}

struct Receiver<'a> {
    service: &'a Arc<Service>,
    tenant: &'a Arc<Tenant>,
    pace: Paced,
    room: Held,
    reserved: Reserved,
}

impl Receiver<'_> {
    async fn read(mut self, mut body: Multipart, idempotency_key: Option<String>) -> Result<NewCageJob, ApiError> {
        let (mut rest, mut frames, mut options) = (None, None, None);
        while let Some(field) = body.next_field().await.map_err(|e| broken(&e))? {
            let part = field.name().unwrap_or_default().to_owned();
            let there = match part.as_str() {
                "rest" => rest.is_some(),
                "frames" => frames.is_some(),
                "options" => options.is_some(),
                _ => return Err(bad(format!("part {part:?} is unknown; send rest, frames and options"))),
            };
            if there {
                return Err(bad(format!("part {part:?} is there twice; send it once")));
            }
            match part.as_str() {
                "rest" => rest = Some(self.read_rest(field).await?),
                "frames" => frames = Some(self.read_frames(field).await?),
                _ => {
                    let request: CageOptions = read_options(field).await?;
                    // Validated before the frames arrive if the part comes first.
                    check_options(&request, &self.service.config)?;
                    options = Some(request);
                }
            }
        }
        let (rest_name, rest) =
            rest.ok_or_else(|| bad("part rest is missing; send the rest pose as a file".to_owned()))?;
        let (frames_name, frames) = frames.ok_or_else(|| {
            bad("part frames is missing; send frames as .npy or raw f32, or make a cage from the rest pose alone by POST /v1/sessions".to_owned())
        })?;
        let (options, room, reserved) = (options.unwrap_or_default(), self.room, self.reserved);
        Ok(NewCageJob { rest_name, rest, frames_name, frames, options, idempotency_key, room, reserved })
    }

    async fn read_rest(&mut self, mut field: Field<'_>) -> Result<(String, Vec<u8>), ApiError> {
        let name = file_name(&field);
        if !name.contains('.') || name.chars().count() > NAME_CHARACTERS {
            let detail = "part \"rest\" needs a file name whose extension says the format, such as rest.obj";
            return Err(bad(detail.to_owned()));
        }
        let limit = self.service.config.max_rest_bytes;
        let mut bytes = Vec::new();
        while let Some(chunk) = self.pace.chunk(&mut field).await? {
            if (bytes.len() + chunk.len()) as u64 > limit {
                return Err(
                    self.too_large(&format!("the rest pose is larger than {limit} bytes; send a lighter model"), limit)
                );
            }
            self.service.make_room(&mut self.room, (bytes.len() + chunk.len()) as u64)?;
            bytes.extend_from_slice(&chunk);
        }
        Ok((name, bytes))
    }

    async fn read_frames(&mut self, mut field: Field<'_>) -> Result<(String, Spool), ApiError> {
        let name = file_name(&field);
        if name.chars().count() > NAME_CHARACTERS {
            return Err(bad(format!("part \"frames\" has a file name of more than {NAME_CHARACTERS} characters")));
        }
        let limit = self.service.config.max_frames_bytes;
        let store = self.service.store.clone();
        let mut spool = blocking(move || store.spool()).await??;
        let mut waiting = BytesMut::new();
        loop {
            let chunk = self.pace.chunk(&mut field).await?;
            let ended = chunk.is_none();
            waiting.extend_from_slice(&chunk.unwrap_or_default());
            if waiting.len() < SPOOL_CHUNK_BYTES && !ended {
                continue;
            }
            if spool.bytes() + waiting.len() as u64 > limit {
                let detail = format!(
                    "the frames have more than {limit} bytes; send every second or fewer, a design looks at 160 at most"
                );
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
                return Ok((if name.is_empty() { "frames".to_owned() } else { name }, spool));
            }
        }
    }

    fn too_large(&self, detail: &str, limit: u64) -> ApiError {
        self.service.rejected("body_too_large");
        ApiError::new(problem::TOO_LARGE, detail).limit(limit)
    }
}
