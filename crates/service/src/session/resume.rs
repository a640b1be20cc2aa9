//! Resuming sessions found on disk.

use super::facts::Outcome;
use super::frames::Frames;
use super::{Phase, Session, Status};
use crate::preparation::{Prepared, ValidOptions};
use crate::problem::{self, ApiError};
use crate::service::Service;
use crate::store::{Completion, Kind, SessionBytes, SessionMeta, Store, StoreError};
use cager_core::inversion::SolverOptions;
use std::sync::Arc;

/// Whether the session was completed, from its completion mark and container.
pub(super) enum CompletionState {
    /// The session was not completed.
    None,
    /// It was completed, and its container has the recorded length.
    Intact(Completion),
    /// It was completed, but the mark or the container is damaged. Completing it again writes the same bytes again from what is stored.
    Damaged,
}

impl CompletionState {
    fn read(store: &Store, id: &str) -> Result<Self, StoreError> {
        let completion = match store.completion(id) {
            Ok(None) => return Ok(Self::None),
            Ok(Some(completion)) => completion,
            Err(error @ StoreError::Damaged { .. }) => {
                tracing::error!(session = %id, %error, "the mark of completion is damaged; complete the session again");
                metrics::counter!("cager_quarantined_total").increment(1);
                return Ok(Self::Damaged);
            }
            Err(error) => return Err(error),
        };
        let expected = completion.container_bytes;
        // It may be readable later.
        let there = store.container_bytes(id).unwrap_or_else(|error| {
            tracing::error!(session = %id, %error, "the container cannot be read");
            expected
        });
        if there != expected {
            tracing::error!(session = %id, there, expected, "the container is incomplete; complete the session again");
            metrics::counter!("cager_quarantined_total").increment(1);
            return Ok(Self::Damaged);
        }
        Ok(Self::Intact(completion))
    }

    /// State of a prepared session with this mark; seals `frames` if it was completed.
    pub(super) fn phase(self, frames: &mut Frames) -> Phase {
        match self {
            Self::None => Phase::Ready,
            Self::Damaged => {
                frames.seal();
                Phase::Ready
            }
            Self::Intact(completion) => {
                frames.seal();
                frames.discard_from(completion.frames);
                Phase::Completed(completion)
            }
        }
    }
}

impl Session {
    /// Verifies length and digest of a completed session's container. A damaged one is written again, byte for byte the same, when the
    /// session is completed again. Blocks.
    pub(crate) fn check_container(&self) {
        let Phase::Completed(completion) = self.status().phase else { return };
        match self.store.container_is_whole(&self.meta.id, &completion) {
            Ok(true) => {}
            Ok(false) => {
                self.container_is_damaged("its content does not match its checksum");
            }
            Err(error) => tracing::warn!(session = %self.meta.id, %error, "the container could not be checked"),
        }
    }

    /// Refuses a solver whose handles differ from those that the session started with, since clients may have sent rows of the old ones;
    /// another version of the program may choose other handles when it prepares again. Acknowledged frames stay.
    ///
    /// # Errors
    /// `SESSION_FAILED`.
    pub(crate) fn check_handles(&self, prepared: &Prepared) -> Result<(), ApiError> {
        let Some(facts) = self.facts() else { return Ok(()) };
        // Where whole frames are read, clients send no rows.
        if !facts.reads_handles_only {
            return Ok(());
        }
        let same = match facts.handles_digest.as_str() {
            "" => self.meta.solver_version == cager_core::SOLVER_VERSION,
            digest => digest == prepared.handles_digest,
        };
        if same {
            return Ok(());
        }
        let detail = "the service was upgraded while this session was open, and its solver now uses other handles; download the solved frames, and upload the remaining ones to a new session";
        Err(ApiError::new(problem::SESSION_FAILED, detail))
    }
}

/// First version of solvers for which what is usual depends on whether frames are coded.
const USUAL_DEPENDS_ON_CODING: u32 = 5;

/// With what an earlier version meant by options that were left out.
fn with_defaults_of_its_version(mut meta: SessionMeta) -> SessionMeta {
    let is_coded = ValidOptions::of(&meta.options).is_ok_and(|valid| valid.goal.is_some());
    if is_coded && meta.solver_version < USUAL_DEPENDS_ON_CODING {
        let SolverOptions { handles, lambda, .. } = SolverOptions::default();
        meta.options.handles.get_or_insert_with(|| handles.name().to_owned());
        meta.options.lambda.get_or_insert(lambda);
    }
    meta
}

impl Service {
    /// Resumes a session found on disk.
    ///
    /// # Errors
    /// Those of the catalogue.
    pub(crate) fn resume(self: &Arc<Self>, meta: SessionMeta) -> Result<(), StoreError> {
        let meta = with_defaults_of_its_version(meta);
        let bytes = self.store.bytes_of_session(&meta).unwrap_or_else(|error| {
            tracing::warn!(session = %meta.id, %error, "its files cannot be counted");
            SessionBytes::default()
        });
        if self.store.damage(Kind::Session, &meta.id)?.is_some() {
            let status = Status { phase: Phase::Failed(super::frames_are_damaged().problem), facts: None };
            self.registry.insert(self.found(meta, status, bytes, &CompletionState::None));
            return Ok(());
        }
        let outcome = match self.store.outcome(Kind::Session, &meta.id) {
            Err(error @ StoreError::Damaged { .. }) => {
                tracing::warn!(session = %meta.id, %error, "the outcome of the preparation is damaged; the session is prepared again");
                None
            }
            outcome => outcome?,
        };
        let mark = CompletionState::read(&self.store, &meta.id)?;
        self.resume_with(meta, outcome, mark, bytes);
        Ok(())
    }

    fn resume_with(
        self: &Arc<Self>,
        meta: SessionMeta,
        outcome: Option<Outcome>,
        mark: CompletionState,
        bytes: SessionBytes,
    ) {
        let failed = |problem| Status { phase: Phase::Failed(problem), facts: None };
        let status = match outcome {
            Some(Outcome::Ready(facts)) => Status { phase: Phase::Ready, facts: Some(*facts) },
            // Earlier versions stored missing content as a failure; the content may have been restored.
            Some(Outcome::Failed(problem)) if problem.word() != problem::SESSION_DELETED.word => failed(problem),
            Some(Outcome::Failed(_)) | None => match ValidOptions::of(&meta.options) {
                Ok(valid) => {
                    let session = self.found(meta, Status { phase: Phase::Preparing, facts: None }, bytes, &mark);
                    self.registry.insert(Arc::clone(&session));
                    self.code_in_background(&session);
                    tokio::spawn(Arc::clone(self).prepare(session, valid, None, mark));
                    return;
                }
                Err(error) => failed(error.problem),
            },
        };
        let ready = status.facts.is_some();
        let session = self.found(meta, status, bytes, &mark);
        if ready {
            let phase = mark.phase(&mut session.frames());
            session.set_phase(phase);
        }
        self.registry.insert(Arc::clone(&session));
        self.code_in_background(&session);
        session.resend_undelivered();
    }

    fn found(&self, meta: SessionMeta, status: Status, bytes: SessionBytes, mark: &CompletionState) -> Arc<Session> {
        let session = Session::new(meta, self, status, false);
        session.set_container_damaged(matches!(mark, CompletionState::Damaged));
        session.set_bytes(bytes);
        Arc::new(session)
    }
}
