//! `POST /v1/recoveries/{id}/frames`: surfaces, each a file.

use crate::http::extract::{Query, RequestedJob};
use crate::http::form::Form;
use crate::http::multipart::{self, FormHeader, NAME_CHARACTERS, bad, broken, file_name};
use crate::http::openapi;
use crate::http::waiting::too_slow;
use crate::problem::{self, ApiError};
use crate::recovery::{Recovery, RecoveryJob};
use crate::service::Service;
use crate::store::NamedFile;
use crate::{admission::Permit, auth::Tenant};
use axum::Json;
use axum::extract::multipart::Field;
use axum::extract::{Request, State};
use cager_proto::recovery_messages::{PostedFrame, PostedFrames};
use serde::Deserialize;
use std::sync::Arc;
use std::time::{Duration, Instant};
use tokio::time::timeout;

/// The query of an upload.
#[derive(Debug, Deserialize, utoipa::IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub(crate) struct FramesQuery {
    /// Number of the first frame in the body, from 0.
    #[serde(default)]
    first: u32,
}

/// Posts frames: one part `frame` for each, in their order, a mesh or point cloud whose file name says the format. The answer comes when all are on
/// disk. A frame that holds no surface is refused by its number and name; those before it in the request are kept. The same frame again changes nothing.
#[utoipa::path(
    post, path = "/v1/recoveries/{id}/frames", operation_id = "post_recovery_frames", tag = "recoveries", params(openapi::JobId, FramesQuery),
    request_body(content = openapi::SurfacesForm, content_type = "multipart/form-data"),
    responses((status = 200, description = "The frames, which are on disk", body = PostedFrames)),
)]
pub(crate) async fn post(
    State(service): State<Arc<Service>>,
    RequestedJob { job, tenant }: RequestedJob<Recovery>,
    Query(query): Query<FramesQuery>,
    request: Request,
) -> Result<Json<PostedFrames>, ApiError> {
    let limit = service.config.max_frames_bytes;
    let FormHeader { patience, .. } = multipart::check_form_header(&service, &request, "frame, one for each", limit)?;
    let _place = service.stream(&tenant)?;
    let mut receiver = Receiver { service, tenant, job: Arc::clone(&job), patience };
    let frames = receiver.read(request, query.first).await?;
    Ok(Json(PostedFrames { frames, received: job.view().frames.received }))
}

struct Receiver {
    service: Arc<Service>,
    tenant: Arc<Tenant>,
    job: Arc<RecoveryJob>,
    /// How long the client may still take to send; what the service does meanwhile is its own affair.
    patience: Duration,
}

/// What a client sends, within the time that is left for it.
async fn in_time<T>(patience: &mut Duration, sent: impl Future<Output = T>) -> Result<T, ApiError> {
    let clock = Instant::now();
    let sent = timeout(*patience, sent).await.map_err(|_| too_slow())?;
    *patience = patience.saturating_sub(clock.elapsed());
    Ok(sent)
}

impl Receiver {
    async fn read(&mut self, request: Request, first: u32) -> Result<Vec<PostedFrame>, ApiError> {
        let mut body = in_time(&mut self.patience, Form::of(request)).await??;
        let (mut frames, mut left) = (Vec::new(), self.service.config.max_frames_bytes);
        while let Some(field) = in_time(&mut self.patience, body.next()).await?? {
            let part = field.name().unwrap_or_default();
            if part != "frame" {
                return Err(bad(format!("part {part:?} is unknown; send frame, once for each")));
            }
            let number = u32::try_from(frames.len()).ok().and_then(|k| first.checked_add(k));
            let number = number.ok_or_else(|| bad("first: frames have numbers below 4294967296".to_owned()))?;
            let (file, room) = self.read_file(field, number, &mut left).await?;
            frames.push(self.service.post_recovery_frame(&self.tenant, &self.job, number, file, room).await?);
        }
        if frames.is_empty() {
            return Err(bad("part frame is missing; send each frame as a file".to_owned()));
        }
        Ok(frames)
    }

    async fn read_file(
        &mut self,
        mut field: Field<'_>,
        frame: u32,
        left: &mut u64,
    ) -> Result<(NamedFile, Permit), ApiError> {
        let name = file_name(&field);
        if !name.contains('.') || name.chars().count() > NAME_CHARACTERS {
            let detail = format!(
                "frame {frame}: needs a file name of at most {NAME_CHARACTERS} characters whose extension says the format, such as scan_0001.ply"
            );
            return Err(ApiError::new(problem::INVALID_FRAME, detail).frame(frame));
        }
        let mut room = Permit::empty(&self.service.upload_memory, &self.tenant.name);
        let limit = self.service.config.max_rest_bytes;
        let mut bytes = Vec::new();
        while let Some(chunk) = in_time(&mut self.patience, field.chunk()).await?.map_err(|e| broken(&e))? {
            let together = (bytes.len() + chunk.len()) as u64;
            *left = left.checked_sub(chunk.len() as u64).ok_or_else(|| {
                let limit = self.service.config.max_frames_bytes;
                self.too_large(
                    &format!("the frames have more than {limit} bytes; send the rest in another request"),
                    limit,
                )
            })?;
            if together > limit {
                let detail = format!("frame {frame}: {name}: is larger than {limit} bytes; send a lighter mesh");
                return Err(self.too_large(&detail, limit).frame(frame));
            }
            self.service.make_room(&mut room, together)?;
            bytes.extend_from_slice(&chunk);
        }
        Ok((NamedFile { name, bytes }, room))
    }

    fn too_large(&self, detail: &str, limit: u64) -> ApiError {
        self.service.rejected("body_too_large");
        ApiError::new(problem::TOO_LARGE, detail).limit(limit)
    }
}
