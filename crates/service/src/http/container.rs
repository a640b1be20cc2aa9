//! `GET /v1/sessions/{id}/capture.cager`: the container, whole or as its frames come.

use super::extract::{Query, RequestedSession};
use super::openapi;
use super::ranged::Immutable;
use super::waiting::prepared;
use crate::admission::Permit;
use crate::auth::Tenant;
use crate::problem::{self, ApiError};
use crate::service::Service;
use crate::session::container_frames::ContainerFrames;
use crate::session::{Phase, Session};
use crate::store::Completion;
use crate::sync::lock;
use crate::tasks::blocking;
use axum::body::Body;
use axum::extract::State;
use axum::response::{IntoResponse, Response};
use bytes::Bytes;
use http::header::{CACHE_CONTROL, CONTENT_DISPOSITION, CONTENT_TYPE};
use http::{HeaderMap, HeaderValue};
use serde::Deserialize;
use std::io::{self, Write};
use std::sync::{Arc, Mutex};

const MEDIA_TYPE: &str = "application/vnd.cager";

/// What of the container.
#[derive(Debug, Deserialize, utoipa::IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub(crate) struct ContainerQuery {
    /// Keep the stream open for frames still to come, until the session is completed. Its bytes are then those of the container, but for errors that
    /// were measured after a frame was sent; before, every whole section can be decoded. It breaks off, without a last chunk, where the session is deleted or fails.
    #[serde(default)]
    follow: bool,
}

/// The container of a completed session. Of a running one whose frames are coded (`max_error`, `mean_error`, `target_size` or `quality`)
/// it has the groups that are coded so far, and `Cager-Frames` says how many frames these are.
#[utoipa::path(
    get, path = "/v1/sessions/{id}/capture.cager", operation_id = "get_container", tag = "results",
    params(openapi::Id, ContainerQuery, openapi::Conditions),
    responses(
        (status = 200, description = "The container", content_type = "application/vnd.cager", body = Vec<u8>,
            headers(("Cager-Frames" = u32, description = "Of a running session: frames in it so far"))),
        (status = 206, description = "The range asked for", content_type = "application/vnd.cager", body = Vec<u8>),
        (status = 304, description = "The client's copy is current"),
    ),
)]
pub(crate) async fn get(
    State(service): State<Arc<Service>>,
    RequestedSession { session, tenant }: RequestedSession,
    Query(query): Query<ContainerQuery>,
    headers: HeaderMap,
) -> Result<Response, ApiError> {
    let mut response = match session.status().phase {
        Phase::Completed(completion) => whole(&service, &session, &tenant, completion, &headers).await?,
        _ if query.follow || (session.goal().is_some() && session.container_problem().is_none()) => {
            partial(service, session, &tenant, query.follow).await?
        }
        _ => {
            if let Some(problem) = session.container_problem() {
                return Err(problem);
            }
            let detail = "the container is written when the session is completed; post {\"frames\": F} to complete, or follow=true to get frames as they come";
            return Err(ApiError::new(problem::NOT_COMPLETED, detail));
        }
    };
    let name = HeaderValue::from_static("attachment; filename=\"capture.cager\"");
    response.headers_mut().insert(CONTENT_DISPOSITION, name);
    Ok(response)
}

async fn whole(
    service: &Service,
    session: &Arc<Session>,
    tenant: &Tenant,
    completion: Completion,
    headers: &HeaderMap,
) -> Result<Response, ApiError> {
    let (of, known) = (Arc::clone(session), completion.clone());
    let file = blocking(move || of.open_container(&known)).await??;
    let Completion { container_bytes, container_digest, .. } = completion;
    let room = Permit::empty(&service.download_memory, &tenant.name);
    let public = !service.access.is_guarded();
    let container = Immutable::of_file(file, 0..container_bytes, container_digest, MEDIA_TYPE, room, public);
    Ok(container.respond_readable(headers).await)
}

/// What is written and not sent yet.
#[derive(Clone, Default)]
struct Unsent(Arc<Mutex<Vec<u8>>>);

impl Unsent {
    fn take(&self) -> Bytes {
        std::mem::take(&mut *lock(&self.0)).into()
    }
}

impl Write for Unsent {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        lock(&self.0).extend_from_slice(bytes);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

/// The container of a running session.
async fn partial(
    service: Arc<Service>,
    session: Arc<Session>,
    tenant: &Tenant,
    follow: bool,
) -> Result<Response, ApiError> {
    let place = service.stream(tenant)?;
    prepared(&service, &session).await?;
    // What is there now; a follower gets more.
    let there = session.coded_frames().unwrap_or_default();
    if !follow && there == 0 {
        let detail =
            "no group of frames is coded yet; post more, follow=true to get them as they come, or complete the session";
        return Err(ApiError::new(problem::NOT_COMPLETED, detail));
    }
    let solver = service.solver(&session).await?;
    let unsent = Unsent::default();
    let (of, out) = (Arc::clone(&session), unsent.clone());
    let frames = blocking(move || {
        ContainerFrames::begin(&of, &solver, &of.geometry()?, out).map_err(|error| ApiError::internal(&error))
    });
    let writing = Writing { frames: Some(frames.await??), unsent, service, session, _place: place };
    let first = futures_util::stream::iter([Ok(writing.unsent.take())]);
    let rest = futures_util::stream::unfold(Some(writing), move |writing| async move {
        let mut writing = writing?;
        match writing.next((!follow).then_some(there)).await {
            Ok((bytes, ended)) => Some((Ok(bytes), (!ended).then_some(writing))),
            Err(error) => Some((Err(error), None)),
        }
    });
    let body = Body::from_stream(futures_util::StreamExt::chain(first, rest));
    let mut response = ([(CONTENT_TYPE, MEDIA_TYPE), (CACHE_CONTROL, "no-store")], body).into_response();
    if !follow {
        response.headers_mut().insert("cager-frames", HeaderValue::from(there));
    }
    Ok(response)
}

/// A container that is sent while it is written.
struct Writing {
    /// `None` while it is written to.
    frames: Option<ContainerFrames<Unsent>>,
    unsent: Unsent,
    service: Arc<Service>,
    session: Arc<Session>,
    _place: Permit,
}

impl Writing {
    /// The next bytes, and whether they are the last ones. It ends with frame `end`, or where the session is completed.
    async fn next(&mut self, end: Option<u32>) -> io::Result<(Bytes, bool)> {
        let mut changes = self.session.changes();
        loop {
            changes.mark_unchanged();
            // Read before the frames, so that no frame is missed.
            let last = match self.session.status().phase {
                Phase::Completed(completion) => Some(end.unwrap_or(completion.frames).min(completion.frames)),
                Phase::Failed(_) => return Err(io::Error::other("the session failed")),
                _ => end,
            };
            match self.write(last).await? {
                // Frames as they were solved wait for their chunk.
                Written::Frames(bytes) if bytes.is_empty() => continue,
                Written::Frames(bytes) => return Ok((bytes, false)),
                Written::End(bytes) => return Ok((bytes, true)),
                Written::Nothing => {}
            }
            tokio::select! {
                changed = changes.changed() => changed.map_err(io::Error::other)?,
                () = self.session.deleted().cancelled() => return Err(io::Error::other("the session was deleted")),
                () = self.service.stopping().cancelled() => return Err(io::Error::other("the service is stopping")),
            }
        }
    }

    async fn write(&mut self, last: Option<u32>) -> io::Result<Written> {
        let Some(mut frames) = self.frames.take() else { return Err(io::Error::other("an earlier write failed")) };
        let (session, unsent) = (Arc::clone(&self.session), self.unsent.clone());
        let work = move || -> io::Result<_> {
            if frames.write_next(&session, last.unwrap_or(u32::MAX))? {
                return Ok((Some(frames), Written::Frames(unsent.take())));
            }
            if last.is_some_and(|last| frames.frames() > last) {
                return Err(io::Error::other("frames that were sent were left out when the session was completed"));
            }
            if last == Some(frames.frames()) {
                frames.finish(&session)?;
                return Ok((None, Written::End(unsent.take())));
            }
            Ok((Some(frames), Written::Nothing))
        };
        let (frames, written) = blocking(work).await.map_err(io::Error::from)??;
        self.frames = frames;
        Ok(written)
    }
}

/// What was written of a container.
enum Written {
    Frames(Bytes),
    Nothing,
    End(Bytes),
}
