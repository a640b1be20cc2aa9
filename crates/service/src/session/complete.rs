//! Completing a session: writes its container once; from then on the session does not change.

use super::container_frames::ContainerFrames;
use super::facts::Outcome;
use super::frames::{Missing, SealError};
use super::{Phase, Session};
use crate::preparation::{self, Geometry, Prepared, ValidOptions, cannot_be_coded};
use crate::problem::{self, ApiError};
use crate::service::Service;
use crate::store::{Completion, SessionMeta, StoreError, StoredPart};
use crate::tasks::{blocking, to_the_end};
use crate::telemetry::traces::TraceSpan;
use crate::webhooks::{Event, PendingMessage};
use cager_capture::coding::{CodingError, Goal};
use cager_core::cage::Cage;
use cager_proto::messages::{Complete, SessionOptions};
use opentelemetry::Context;
use std::io::{self, BufWriter, Write};
use std::sync::Arc;
use std::sync::atomic::Ordering::{Acquire, Relaxed, Release};
use std::time::Duration;
use tokio::time::timeout;

/// Longest wait for a change notification before checking again whether frames are still being measured.
const MEASURING_POLL_INTERVAL: Duration = Duration::from_secs(1);
impl Service {
    /// Declares that the session has `frames` frames, and writes its container. Runs to the end even if the client disconnects.
    pub(crate) async fn complete(self: &Arc<Self>, session: &Arc<Session>, request: Complete) -> Result<(), ApiError> {
        // A client that disconnects while queued has not started the work.
        let place = self.completing.take(&session.meta.tenant, 1).await;
        let (service, session) = (Arc::clone(self), Arc::clone(session));
        let work = async move {
            let _place = place;
            let _one = session.completing.lock().await;
            let _step = TraceSpan::begin("complete", &Context::current());
            service.complete_alone(&session, request).await
        };
        to_the_end(work).await
    }

    async fn complete_alone(self: &Arc<Self>, session: &Arc<Session>, request: Complete) -> Result<(), ApiError> {
        let resolving = Arc::clone(session);
        blocking(move || resolving.resolve_completion()).await??;
        let frames = request.frames;
        match session.status().phase {
            Phase::Completed(completion) if completion.frames == frames => return Ok(()),
            Phase::Completed(completion) => {
                let detail = format!("the session was completed with {} frames, not {frames}", completion.frames);
                return Err(ApiError::new(problem::SESSION_COMPLETED, detail));
            }
            Phase::Failed(problem) => {
                return Err(ApiError::new(problem::SESSION_FAILED, problem.detail));
            }
            Phase::Preparing => {
                let detail = "the session is still being prepared and has no frames";
                return Err(ApiError::new(problem::NOT_READY, detail).retry_after(1));
            }
            Phase::Ready => {}
        }
        if frames == 0 {
            return Err(ApiError::new(problem::INVALID_OPTIONS, "frames: a capture has at least one frame"));
        }
        let expected = session.meta.options.frames;
        if expected.is_some_and(|expected| frames > expected) {
            let detail =
                format!("frames: is {frames}, and the session was created for {}", expected.unwrap_or_default());
            return Err(ApiError::new(problem::INVALID_OPTIONS, detail));
        }
        session.check_end(frames)?;
        let before = loop {
            let mut changes = session.changes();
            if let Some(sealed) = session.seal_at(frames, request.discard_beyond)? {
                break sealed;
            }
            let _ = timeout(MEASURING_POLL_INTERVAL, changes.changed()).await;
        };
        let mut sealed = UnsealOnFailure { session, kept: before };
        session.check_end(frames)?;
        let written = self.write_completely(session, frames).await;
        if written.is_err() {
            let failed = Arc::clone(session);
            blocking(move || failed.undo_completion()).await?;
        }
        let Written { completion, due } = written.map_err(|error| match session.status().phase {
            // The log or the content turned out to be damaged.
            Phase::Failed(problem) => ApiError::new(problem::SESSION_FAILED, problem.detail),
            _ => error,
        })?;
        session.completed(completion);
        sealed.kept = true;
        let cleaned = Arc::clone(session);
        blocking(move || cleaned.remove_uncoded(frames)).await?;
        session.forget_coder();
        if let Some(due) = due {
            session.announce(due);
        }
        Ok(())
    }
}

impl Service {
    /// Codes what is left and writes container and completion mark.
    async fn write_completely(self: &Arc<Self>, session: &Arc<Session>, frames: u32) -> Result<Written, ApiError> {
        self.code_rest(session, frames).await?;
        let prepared = self.solver(session).await?;
        let (writing, writers) = (Arc::clone(session), Arc::clone(&self.container_writers));
        blocking(move || writers.install(|| write(&writing, &prepared, frames))).await?
    }
}

/// Lets the session accept frames again if its completion fails.
struct UnsealOnFailure<'a> {
    session: &'a Session,
    kept: bool,
}

impl Drop for UnsealOnFailure<'_> {
    fn drop(&mut self) {
        if !self.kept && !self.session.completion_unknown.load(Acquire) {
            self.session.frames().unseal();
        }
    }
}

impl Session {
    /// Stops accepting new frames, so that no acknowledged frame is missing from the container. Returns whether the session was sealed
    /// before; `None` while some of its frames are still being measured.
    ///
    /// # Errors
    /// `FRAMES_MISSING`; `FRAME_CONFLICT` for a frame beyond the end.
    fn seal_at(&self, frames: u32, discard_beyond: bool) -> Result<Option<bool>, ApiError> {
        match self.frames().seal_at(frames, discard_beyond) {
            Ok(before) => Ok(Some(before)),
            Err(SealError::Measuring) => Ok(None),
            Err(SealError::Missing(Missing { ranges, next })) => {
                let count: u64 = ranges.iter().map(|[a, b]| u64::from(b - a)).sum();
                let more = if next.is_some() { " or more" } else { "" };
                let detail =
                    format!("{count}{more} of {frames} frames are missing; post them, then complete the session");
                Err(ApiError::new(problem::FRAMES_MISSING, detail).missing(ranges))
            }
            Err(SealError::Beyond(frame)) => {
                let detail = format!(
                    "frame {frame} was posted, so the capture has more than {frames} frames; set discard_beyond to leave it out"
                );
                Err(ApiError::new(problem::FRAME_CONFLICT, detail).frame(frame))
            }
        }
    }

    /// Records the completion.
    fn completed(&self, completion: Completion) {
        self.frames().discard_from(completion.frames);
        self.keep_last_groups();
        self.set_container_damaged(false);
        self.set_phase(Phase::Completed(completion));
    }

    /// Counts the container as it is on disk now, whether or not the session is complete with it. Blocks.
    fn count_container(&self) {
        let before = self.container.load(Relaxed);
        // What cannot be read is what was there before, or is counted by the next attempt.
        let now = self.store.container_bytes(&self.meta.id).unwrap_or(before);
        self.container.store(now, Relaxed);
        self.bytes.fetch_add(now, Relaxed);
        self.bytes.fetch_sub(before, Relaxed);
    }

    /// Removes what a completion has left that has failed, unless it may yet turn out to have succeeded. Blocks.
    fn undo_completion(&self) {
        if self.completion_unknown.load(Acquire) || self.has_failed() {
            return;
        }
        self.drop_last_groups();
        if let Err(error) = self.store.remove_container(&self.meta.id) {
            tracing::warn!(session = %self.meta.id, %error, "the container of a failed completion takes space");
        }
        self.count_container();
    }

    /// If writing the completion mark failed, reads back whether it is on disk. The caller holds `completing`. Blocks.
    ///
    /// # Errors
    /// The mark still cannot be read.
    pub(crate) fn resolve_completion(&self) -> Result<(), ApiError> {
        if !self.completion_unknown.load(Acquire) {
            return Ok(());
        }
        match self.store.completion(&self.meta.id).map_err(|error| self.fail_if_damaged(error))? {
            Some(completion) => {
                let frames = completion.frames;
                self.completed(completion);
                self.remove_uncoded(frames);
                self.resend_undelivered();
                self.completion_unknown.store(false, Release);
            }
            None => {
                self.completion_unknown.store(false, Release);
                self.undo_completion();
                self.frames().unseal();
            }
        }
        Ok(())
    }

    /// As [`Self::resolve_completion`], for callers that do not hold `completing`.
    ///
    /// # Errors
    /// As [`Self::resolve_completion`].
    pub(crate) async fn completion_resolved(self: &Arc<Self>) -> Result<(), ApiError> {
        if !self.completion_unknown.load(Acquire) {
            return Ok(());
        }
        let _one = self.completing.lock().await;
        let session = Arc::clone(self);
        blocking(move || session.resolve_completion()).await?
    }

    /// Writes the completion mark. If it fails and cannot be read back, whether the session is complete is unknown until [`Self::resolve_completion`].
    fn mark(&self, completion: &Completion) -> Result<(), StoreError> {
        // The outcome of the preparation may not be stored yet, and without it a restart would prepare a session that is complete.
        let outcome = self.facts().map(|facts| Outcome::Ready(Box::new(facts)));
        let Err(error) = self.store.complete(&self.meta.id, completion, outcome.as_ref()) else { return Ok(()) };
        // The mark may be in place although writing it failed.
        match self.store.completion(&self.meta.id) {
            Ok(Some(found)) if found == *completion => Ok(()),
            Ok(_) => Err(error),
            Err(_) => {
                self.completion_unknown.store(true, Release);
                Err(error)
            }
        }
    }

    /// Reads rest pose and cage again. Blocks.
    ///
    /// # Errors
    /// Storage errors; `SESSION_DELETED`.
    pub(crate) fn geometry(&self) -> Result<Geometry, ApiError> {
        let content = self.store.content(&self.meta.key).map_err(|error| self.storage_error(error))?;
        let content = content.ok_or_else(|| self.missing_content_error())?;
        preparation::read(&content, &ValidOptions::of(&self.meta.options)?)
    }

    /// What is known of its rest pose, its cage and its matrix without reading them. Blocks.
    ///
    /// # Errors
    /// Storage errors; `SESSION_DELETED`.
    pub(crate) fn files(&self) -> Result<[Option<StoredPart>; 3], ApiError> {
        let files = self.store.content_parts(&self.meta.key).map_err(|error| self.storage_error(error))?;
        files.ok_or_else(|| self.missing_content_error())
    }

    /// Its options as they were sent: what an earlier version meant by those that were left out is not among them. Blocks.
    ///
    /// # Errors
    /// Storage errors.
    pub(crate) fn sent_options(&self) -> Result<SessionOptions, ApiError> {
        let stored = self.store.reload_meta::<SessionMeta>(&self.meta.id).map_err(|error| self.storage_error(error))?;
        Ok(stored.map_or_else(|| self.meta.options.clone(), |meta| meta.options))
    }

    fn missing_content_error(&self) -> ApiError {
        self.explain_missing_content(super::gone())
    }

    /// Reads the rest cage again without the rest pose. Blocks.
    ///
    /// # Errors
    /// Storage errors; `SESSION_DELETED`.
    pub(crate) fn rest_cage(&self) -> Result<Cage, ApiError> {
        let valid = ValidOptions::of(&self.meta.options)?;
        if valid.goal.is_some() {
            return Ok(self.geometry()?.cage);
        }
        let file = self.store.content_cage(&self.meta.key).map_err(|error| self.storage_error(error))?;
        preparation::read_cage(&file.ok_or_else(|| self.missing_content_error())?, &valid)
    }
}

/// The result of writing a container and the completion mark.
struct Written {
    completion: Completion,
    /// The webhook message to send.
    due: Option<PendingMessage>,
}

fn write(session: &Session, prepared: &Prepared, frames: u32) -> Result<Written, ApiError> {
    let stored = |error: StoreError| session.storage_error(error);
    let geometry = session.geometry()?;
    let mut write = |out: &mut dyn Write| -> io::Result<()> {
        let out = BufWriter::with_capacity(1 << 20, out);
        let mut container = ContainerFrames::begin(session, prepared, &geometry, out)?.completing();
        while container.write_next(session, frames)? {}
        if container.frames() < frames {
            return Err(io::Error::other(format!("frame {} is not there", container.frames())));
        }
        container.finish(session)?.flush()
    };
    let written = session.store.write_container(&session.meta.id, &mut write);
    session.count_container();
    let written = written.map_err(stored)?;
    if let Some(Goal::Size(asked)) = session.goal()
        && written.bytes > asked
    {
        return Err(cannot_be_coded(Goal::Size(asked), &CodingError::TooSmall { asked, least: written.bytes }));
    }
    let completion = Completion { frames, container_bytes: written.bytes, container_digest: written.digest };
    let due = session.webhooks.store_pending(&session.about(), Event::Completed).map_err(stored)?;
    session.mark(&completion).map_err(stored)?;
    Ok(Written { completion, due })
}
