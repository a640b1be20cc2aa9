//! Completing a session: its container is written once and never changes.

use super::create::blocking;
use super::frames::Unsealed;
use super::prepare::{self, Choices};
use super::prepared::Prepared;
use super::runs::Missing;
use super::{Phase, Session};
use crate::capture::{CaptureWriter, Encoding, StoredError};
use crate::problem::{self, ApiError};
use crate::service::Service;
use crate::store::{CageFile, Completion, Content, LogEntry, StoreError};
use crate::telemetry::traces::Step;
use crate::webhooks::{Due, Event, Webhooks};
use cager_core::cage::Cage;
use cager_proto::container;
use cager_proto::messages::Complete;
use opentelemetry::Context;
use opentelemetry::trace::FutureExt as _;
use std::io::{self, BufWriter, Write};
use std::sync::Arc;
use std::sync::atomic::Ordering::{Acquire, Relaxed, Release};
use std::time::Duration;
use tokio::time::timeout;

/// How long a change is waited for, before it is looked again whether frames are still being measured.
const MEASURED_WITHIN: Duration = Duration::from_secs(1);
/// Frames read from the log at a time.
const READ_FRAMES: usize = 64;

impl Service {
    /// Says that a session has `frames` frames, and writes its container. Once begun, it goes on where the client gives up.
    pub(crate) async fn complete(self: &Arc<Self>, session: &Arc<Session>, wish: Complete) -> Result<(), ApiError> {
        // Who gives up while it waits for its turn has not begun.
        let place = self.completing.take(&session.meta.tenant, 1).await;
        let (service, session) = (Arc::clone(self), Arc::clone(session));
        let work = async move {
            let _place = place;
            let _one = session.completing.lock().await;
            let _step = Step::begin("complete", &Context::current());
            service.complete_alone(&session, wish).await
        };
        let work = tokio::spawn(work.with_current_context());
        work.await.map_err(|error| ApiError::internal(&error))?
    }

    async fn complete_alone(self: &Arc<Self>, session: &Arc<Session>, wish: Complete) -> Result<(), ApiError> {
        let settling = Arc::clone(session);
        blocking(move || settling.settle()).await??;
        let frames = wish.frames;
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
            let detail = format!("frames: is {frames}, and the session was made for {}", expected.unwrap_or_default());
            return Err(ApiError::new(problem::INVALID_OPTIONS, detail));
        }
        let (before, entries) = loop {
            let mut changes = session.changes();
            if let Some(sealed) = session.seal_at(frames, wish.discard_beyond)? {
                break sealed;
            }
            let _ = timeout(MEASURED_WITHIN, changes.changed()).await;
        };
        let mut sealed = Sealed { session, kept: before };
        let prepared = self.solver(session).await?;
        let (writing, webhooks) = (Arc::clone(session), Arc::clone(&self.webhooks));
        let writers = Arc::clone(&self.container_writers);
        let work = move || writers.install(|| write(&writing, &prepared, &entries, frames, &webhooks));
        let written = blocking(work).await?;
        let Written { completion, replaced, due } = written.map_err(|error| match session.status().phase {
            // What was to be written proved damaged.
            Phase::Failed(problem) => ApiError::new(problem::SESSION_FAILED, problem.detail),
            _ => error,
        })?;
        session.completed(completion, replaced);
        sealed.kept = true;
        if let Some(due) = due {
            self.webhooks.tell(session, due);
        }
        Ok(())
    }
}

/// Lets a session take frames again where its completion fails.
struct Sealed<'a> {
    session: &'a Session,
    kept: bool,
}

impl Drop for Sealed<'_> {
    fn drop(&mut self) {
        if !self.kept && !self.session.unsettled.load(Acquire) {
            self.session.frames().unseal();
        }
    }
}

impl Session {
    /// Takes no new frames from here on, so that none is answered that the container would lack. Gives whether none were taken before, and
    /// what the container holds; None while frames of it are being measured.
    ///
    /// # Errors
    /// Frames that are missing, or beyond the end.
    fn seal_at(&self, frames: u32, discard_beyond: bool) -> Result<Option<(bool, Vec<LogEntry>)>, ApiError> {
        let mut known = self.frames();
        match known.seal_at(frames, discard_beyond) {
            Ok(before) => {
                let entries = known.entries().take_while(|entry| entry.frame < frames).copied().collect();
                Ok(Some((before, entries)))
            }
            Err(Unsealed::Measuring) => Ok(None),
            Err(Unsealed::Missing(Missing { ranges, next })) => {
                let count: u64 = ranges.iter().map(|[a, b]| u64::from(b - a)).sum();
                let more = if next.is_some() { " or more" } else { "" };
                let detail =
                    format!("{count}{more} of {frames} frames are missing; post them, then complete the session");
                Err(ApiError::new(problem::FRAMES_MISSING, detail).missing(ranges))
            }
            Err(Unsealed::Beyond(frame)) => {
                let detail = format!(
                    "frame {frame} was posted, so the capture has more than {frames} frames; say discard_beyond to leave it out"
                );
                Err(ApiError::new(problem::FRAME_CONFLICT, detail).frame(frame))
            }
        }
    }

    /// It is completed; its container took the place of one of so many bytes.
    fn completed(&self, completion: Completion, replaced: u64) {
        self.frames().discard_from(completion.frames);
        self.bytes.fetch_add(completion.container_bytes, Relaxed);
        self.bytes.fetch_sub(replaced, Relaxed);
        self.set_phase(Phase::Completed(completion));
    }

    /// Finds out what became of a mark of completion whose writing failed, if that is not known. The caller holds `completing`. Blocks.
    ///
    /// # Errors
    /// It still cannot be known.
    pub(crate) fn settle(&self) -> Result<(), ApiError> {
        if !self.unsettled.load(Acquire) {
            return Ok(());
        }
        match self.store.completion(&self.meta.id).map_err(|error| self.damaged_or(error))? {
            Some(completion) => {
                self.completed(completion, 0);
                self.webhooks.tell_left(self);
            }
            None => self.frames().unseal(),
        }
        self.unsettled.store(false, Release);
        Ok(())
    }

    /// As [`Self::settle`], for who does not complete it.
    ///
    /// # Errors
    /// As [`Self::settle`].
    pub(crate) async fn settled(self: &Arc<Self>) -> Result<(), ApiError> {
        if !self.unsettled.load(Acquire) {
            return Ok(());
        }
        let _one = self.completing.lock().await;
        let session = Arc::clone(self);
        blocking(move || session.settle()).await?
    }

    /// Marks the session complete. Where even the failure is not certain, it is unsettled from here on.
    fn mark(&self, completion: &Completion) -> Result<(), StoreError> {
        let Err(error) = self.store.complete(&self.meta.id, completion) else { return Ok(()) };
        // It may be there, durable or not.
        match self.store.completion(&self.meta.id) {
            Ok(Some(found)) if found == *completion => Ok(()),
            Ok(_) => Err(error),
            Err(_) => {
                self.unsettled.store(true, Release);
                Err(error)
            }
        }
    }

    fn content(&self) -> Result<Content, ApiError> {
        let content = self.store.content(&self.meta.key).map_err(|error| self.storage_error(&error))?;
        content.ok_or_else(|| self.content_is_gone())
    }

    fn content_is_gone(&self) -> ApiError {
        self.content_or(super::gone())
    }

    /// Reads the rest cage again, and nothing of the rest pose. Blocks.
    ///
    /// # Errors
    /// Those of the disk; a session that was deleted.
    pub(crate) fn rest_cage(&self) -> Result<Cage, ApiError> {
        let file = self.store.content_cage(&self.meta.key).map_err(|error| self.storage_error(&error))?;
        let CageFile { name, bytes } = file.ok_or_else(|| self.content_is_gone())?;
        prepare::read_cage(&name, &bytes, &Choices::of(&self.meta.options)?)
    }
}

/// A container that was written, and its session marked.
struct Written {
    completion: Completion,
    /// Bytes of the one before.
    replaced: u64,
    /// Who has to be told.
    due: Option<Due>,
}

fn write(
    session: &Session,
    prepared: &Prepared,
    entries: &[LogEntry],
    frames: u32,
    webhooks: &Webhooks,
) -> Result<Written, ApiError> {
    let stored = |error: StoreError| session.storage_error(&error);
    let choices = Choices::of(&session.meta.options)?;
    let geometry = prepare::read(&session.content()?, &choices)?;
    let encoding = Encoding {
        rest: &geometry.rest,
        cage: &geometry.cage,
        system: choices.system,
        options: prepared.options,
        solver: &prepared.solver,
        frame_rate: session.meta.options.frame_rate,
    };
    let mut write = |out: &mut dyn Write| write_frames(session, &encoding, entries, out);
    // Of a container that was damaged, which counts already.
    let replaced = session.store.container_bytes(&session.meta.id).unwrap_or(0);
    let written = session.store.write_container(&session.meta.id, &mut write).map_err(stored)?;
    let completion = Completion { frames, container_bytes: written.bytes, container_digest: written.digest };
    let due = webhooks.keep(session, Event::Completed).map_err(stored)?;
    session.mark(&completion).map_err(stored)?;
    Ok(Written { completion, replaced, due })
}

fn write_frames(
    session: &Session,
    encoding: &Encoding<'_>,
    entries: &[LogEntry],
    out: &mut dyn Write,
) -> io::Result<()> {
    let plain = |error: container::Error| match error {
        container::Error::Io(error) => error,
        other => io::Error::other(other.to_string()),
    };
    let mut writer = CaptureWriter::new(BufWriter::with_capacity(1 << 20, out), encoding).map_err(plain)?;
    let row_bytes = 12 * encoding.solver.decoder().unknowns();
    let (mut bytes, mut cage) = (Vec::new(), Vec::new());
    for entries in entries.chunks(READ_FRAMES) {
        bytes.clear();
        session.read_cages(entries, &mut bytes)?;
        for (entry, bytes) in entries.iter().zip(bytes.chunks_exact(row_bytes)) {
            cage.clear();
            cage.extend(bytes.chunks_exact(4).map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]])));
            let error = StoredError { l2: entry.l2, linf: entry.linf, squared: entry.squared, spread: entry.spread };
            writer.write_frame(&cage, &error).map_err(plain)?;
        }
    }
    writer.finish().map_err(plain)?.0.flush()
}
