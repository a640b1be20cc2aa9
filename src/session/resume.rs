//! Going on with sessions found on disk.

use super::create::OUTCOME;
use super::facts::Outcome;
use super::frames::Frames;
use super::prepare::Choices;
use super::prepared::Prepared;
use super::{Phase, Session, Status};
use crate::problem::{self, ApiError};
use crate::service::Service;
use crate::store::{Completion, Kind, SessionMeta, Store, StoreError};
use crate::unread;
use std::sync::Arc;
use std::sync::atomic::Ordering::Relaxed;

/// What the mark of completion says.
pub(super) enum Mark {
    /// The session was not completed.
    None,
    /// It was, and its container is there.
    Whole(Completion),
    /// It was, and mark or container are damaged: it is written again from the log, to the same bytes, when it is completed again.
    Damaged,
}

impl Mark {
    fn read(store: &Store, id: &str) -> Result<Self, StoreError> {
        let completion = match store.completion(id) {
            Ok(None) => return Ok(Self::None),
            Ok(Some(completion)) => completion,
            Err(error @ StoreError::Damaged { .. }) => {
                tracing::error!(session = %id, %error, "the mark of completion is damaged; complete the session again");
                return Ok(Self::Damaged);
            }
            Err(error) => return Err(error),
        };
        let (there, expected) = (store.container_bytes(id)?, completion.container_bytes);
        if there != expected {
            tracing::error!(session = %id, there, expected, "the container is not whole; complete the session again");
            return Ok(Self::Damaged);
        }
        Ok(Self::Whole(completion))
    }

    /// Where a prepared session stands, with this in its frames: one that was completed takes no new ones.
    pub(super) fn phase(self, frames: &mut Frames) -> Phase {
        match self {
            Self::None => Phase::Ready,
            Self::Damaged => {
                frames.seal();
                Phase::Ready
            }
            Self::Whole(completion) => {
                frames.seal();
                frames.discard_from(completion.frames);
                Phase::Completed(completion)
            }
        }
    }
}

impl Session {
    /// Looks whether the container of a completed session still is what was written. One that is not is written again, to the same bytes,
    /// when the session is completed again. Blocks.
    pub(crate) fn check_container(&self) {
        let Phase::Completed(completion) = self.status().phase else { return };
        match self.store.container_is_whole(&self.meta.id, &completion) {
            Ok(true) => {}
            Ok(false) => {
                tracing::error!(session = %self.meta.id, "the container is damaged; complete the session again");
                let phase = Mark::Damaged.phase(&mut self.frames());
                self.set_phase(phase);
            }
            Err(error) => tracing::warn!(session = %self.meta.id, %error, "the container could not be checked"),
        }
    }
}

impl Session {
    /// Refuses a solver that reads other points than the one that the session began with, which clients may have sent the rows of: another
    /// version of the program may choose others where it has to prepare anew. What was answered stays.
    ///
    /// # Errors
    /// What to do.
    pub(crate) fn check_handles(&self, prepared: &Prepared) -> Result<(), ApiError> {
        let Some(facts) = self.facts() else { return Ok(()) };
        let same = match facts.handles_digest.as_str() {
            "" => self.meta.solver_version == cager_core::SOLVER_VERSION,
            digest => digest == prepared.handles_digest,
        };
        if same {
            return Ok(());
        }
        let detail = "the service was upgraded while this session was open, and reads other points of the model now; its frames can be downloaded, and the rest has to be uploaded to a new session";
        Err(ApiError::new(problem::SESSION_FAILED, detail))
    }
}

impl Service {
    /// Goes on with a session found on disk. One whose files cannot be read is known as failed, so that it can be deleted, and comes up
    /// when this is called again.
    ///
    /// # Errors
    /// What the system says of its files.
    pub(crate) fn resume(self: &Arc<Self>, meta: SessionMeta) -> Result<(), StoreError> {
        let outcome = match self.store.note(&meta.id, OUTCOME) {
            Err(error @ StoreError::Damaged { .. }) => {
                tracing::warn!(session = %meta.id, %error, "what preparing found is damaged, so it is done again");
                Ok(None)
            }
            outcome => outcome,
        };
        match outcome.and_then(|outcome| Ok((outcome, Mark::read(&self.store, &meta.id)?))) {
            Ok((outcome, mark)) => {
                self.resume_with(meta, outcome, mark);
                Ok(())
            }
            Err(error) => {
                let problem = unread::problem(Kind::Session).problem;
                self.registry.insert(self.found(meta, Status { phase: Phase::Failed(problem), facts: None }));
                Err(error)
            }
        }
    }

    fn resume_with(self: &Arc<Self>, meta: SessionMeta, outcome: Option<Outcome>, mark: Mark) {
        let failed = |problem| Status { phase: Phase::Failed(problem), facts: None };
        let status = match outcome {
            Some(Outcome::Ready(facts)) => Status { phase: Phase::Ready, facts: Some(*facts) },
            // Earlier versions kept that the rest pose was missing; it may be there again.
            Some(Outcome::Failed(problem)) if problem.word() != problem::SESSION_DELETED.word => failed(problem),
            Some(Outcome::Failed(_)) | None => match Choices::of(&meta.options) {
                Ok(choices) => {
                    let session = self.found(meta, Status { phase: Phase::Preparing, facts: None });
                    self.registry.insert(Arc::clone(&session));
                    tokio::spawn(Arc::clone(self).prepare(session, choices, None, mark));
                    return;
                }
                Err(error) => failed(error.problem),
            },
        };
        let ready = status.facts.is_some();
        let session = self.found(meta, status);
        if ready {
            session.has_log.store(true, Relaxed);
            let phase = mark.phase(&mut session.frames());
            session.set_phase(phase);
        }
        self.registry.insert(Arc::clone(&session));
        self.webhooks.tell_left(&session);
    }

    fn found(&self, meta: SessionMeta, status: Status) -> Arc<Session> {
        let session = Session::new(meta, self, status, false);
        let bytes = self.store.session_bytes(&session.meta.id) + self.store.content_bytes(&session.meta.key);
        session.bytes.store(bytes, Relaxed);
        Arc::new(session)
    }
}
