//! Frames of a job on their way to a client: those that are there, or all as they are made.

use crate::admission::Permit;
use crate::auth::Tenant;
use crate::jobs::{Frames, Job, Phase, Piece, Work};
use crate::problem::{self, ApiError};
use crate::service::Service;
use crate::tasks::blocking;
use axum::body::Body;
use axum::response::{IntoResponse, Response};
use bytes::Bytes;
use http::header;
use serde::Deserialize;
use std::io;
use std::sync::Arc;

pub(super) const OCTETS: &str = "application/octet-stream";

/// Which frames.
#[derive(Clone, Copy, Debug, Deserialize, utoipa::IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub(crate) struct FramesOfJob {
    /// First frame.
    #[serde(default)]
    pub(super) first: u32,
    /// Number of frames; all that are there where it is left out.
    pub(super) count: Option<u32>,
    /// Keep the stream open for frames still to be made, in order, to the last one.
    #[serde(default)]
    pub(super) follow: bool,
}

impl FramesOfJob {
    /// How many of the frames asked for are there, of those that are `done`.
    ///
    /// # Errors
    /// The job failed, or not all are there.
    pub(super) fn there<W: Work>(&self, job: &Job<W>, done: u32) -> Result<u32, ApiError> {
        if let Phase::Failed(problem) = job.phase() {
            return Err(ApiError::new(W::FAILED, problem.detail));
        }
        let there = done.saturating_sub(self.first);
        if let Some(count) = self.count.filter(|&count| !self.follow && count > there) {
            let first = self.first;
            let detail =
                format!("{there} of the {count} frames from {first} on are there; request fewer, or use follow=true");
            return Err(ApiError::new(problem::FRAMES_MISSING, detail));
        }
        Ok(there)
    }
}

/// The frames of a job as `read` gives them, at most `piece` at a time.
///
/// # Errors
/// Too many streams, or no memory for a piece of `piece_bytes`.
pub(super) fn stream<W: Work>(
    service: Arc<Service>,
    tenant: &Tenant,
    job: Arc<Job<W>>,
    (query, there): (FramesOfJob, u32),
    (piece, piece_bytes): (u32, u64),
    read: Box<dyn Frames<W>>,
) -> Result<Response, ApiError> {
    let place = service.stream(tenant)?;
    let mut room = Permit::empty(&service.download_memory, &tenant.name);
    if piece_bytes > 0 {
        room.grow(piece_bytes).map_err(|full| {
            service.rejected("download_memory");
            full.refusal("memory for downloads")
        })?;
    }
    let FramesOfJob { first, count, follow } = query;
    let end = match (count, follow) {
        (Some(count), _) => Some(first.saturating_add(count)),
        (None, true) => None,
        (None, false) => Some(first + there),
    };
    let following =
        Following { service, job, read: Some(read), next: first, end, piece, decoding: None, held: [place, room] };
    let stream = futures_util::stream::unfold(Some(following), |following| async move {
        let mut following = following?;
        match following.piece().await {
            Ok(Some(bytes)) => Some((Ok(bytes), Some(following))),
            Ok(None) => None,
            Err(error) => Some((Err(error), None)),
        }
    });
    let headers = [(header::CONTENT_TYPE, OCTETS), (header::CACHE_CONTROL, "no-store")];
    Ok((headers, Body::from_stream(stream)).into_response())
}

struct Following<W: Work> {
    service: Arc<Service>,
    job: Arc<Job<W>>,
    /// Elsewhere while it reads.
    read: Option<Box<dyn Frames<W>>>,
    next: u32,
    /// The frame after the last one, where that is known.
    end: Option<u32>,
    piece: u32,
    /// The memory of what decodes, once that is there.
    decoding: Option<Arc<Permit>>,
    /// The place among streams, and memory for a piece.
    held: [Permit; 2],
}

impl<W: Work> Following<W> {
    /// The next frames; nothing after the last one.
    async fn piece(&mut self) -> io::Result<Option<Bytes>> {
        let mut changes = self.job.changes();
        loop {
            changes.mark_unchanged();
            let left = self.end.map_or(self.piece, |end| end.saturating_sub(self.next).min(self.piece));
            if left == 0 {
                return Ok(None);
            }
            if self.job.deleted().is_cancelled() {
                return Err(deleted());
            }
            let Some(mut read) = self.read.take() else { return Ok(None) };
            let decodes = read.decodes(&self.job);
            let place = match decodes {
                Some(bytes) => Some(self.place(bytes).await?),
                None => None,
            };
            let (job, next) = (Arc::clone(&self.job), self.next);
            let (read, piece) = blocking(move || {
                let piece = read.read(&job, next, left, place.is_some());
                (read, piece)
            })
            .await
            .map_err(io::Error::from)?;
            self.read = Some(read);
            let Piece { bytes, frames, is_last } = piece?;
            if frames > 0 {
                self.next += frames;
                return Ok(Some(bytes.into()));
            }
            if is_last {
                return Ok(None);
            }
            tokio::select! {
                _ = changes.changed() => {}
                () = self.job.deleted().cancelled() => return Err(deleted()),
                () = self.service.stopping().cancelled() => return Err(io::Error::other("the service is stopping")),
            }
        }
    }

    /// A place among those that decode, and the memory that this reader keeps from its first one on. Both are waited for here and not on a thread that may
    /// block: of those there are few, and a client that hangs up leaves the queue.
    async fn place(&mut self, bytes: u64) -> io::Result<(Permit, Arc<Permit>)> {
        let Self { service, job, decoding, held: [_, room], .. } = self;
        let tenant = room.tenant();
        let taken = async {
            let memory = match decoding.take() {
                Some(memory) => memory,
                None => Arc::new(service.decoding_memory.take(tenant, bytes).await),
            };
            *decoding = Some(Arc::clone(&memory));
            (service.coding.take(tenant, 1).await, memory)
        };
        tokio::select! {
            taken = taken => Ok(taken),
            () = job.deleted().cancelled() => Err(deleted()),
            () = service.stopping().cancelled() => Err(io::Error::other("the service is stopping")),
        }
    }
}

fn deleted() -> io::Error {
    io::Error::other("the job was deleted")
}
