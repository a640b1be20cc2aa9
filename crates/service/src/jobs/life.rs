//! Jobs found on disk, ended and deleted.

use super::{Job, Outcome, Phase, Run, Work, kind_of};
use crate::problem::{self, ApiError};
use crate::service::Service;
use crate::store::{JobMeta as _, RecordMeta as _, StoreError, Workshop};
use crate::tasks::{Pauses, blocking, to_the_end};
use crate::webhooks::Event;
use std::borrow::Cow;
use std::sync::Arc;
use std::sync::atomic::Ordering::{Relaxed, SeqCst};

/// How work on a job ended whose results are files.
pub(crate) enum Ended<F> {
    Completed(Box<F>, Workshop),
    Failed(ApiError),
    /// It ended the process too often; what was sent is kept.
    GivenUp(ApiError),
    /// There is nothing to do for a while, the job was deleted, or the service is stopping.
    Paused,
}

impl<F> Ended<F> {
    /// Whether the store did not answer, or had no room, so that the same may succeed later.
    pub(super) fn is_held_up(&self) -> bool {
        matches!(self, Self::Failed(error) if error.passes)
    }
}

impl Service {
    /// Resumes a job found on disk; one without outcome is begun again. One whose files cannot be read has failed until the next start.
    ///
    /// # Errors
    /// Those of the catalogue.
    pub(crate) fn resume_job<W: Run>(self: &Arc<Self>, meta: W::Meta) -> Result<(), StoreError> {
        let (id, kind) = (meta.id().to_owned(), kind_of::<W>());
        let is_damaged = self.store.damage(kind, &id)?.is_some();
        let phase = match self.store.outcome(kind, &id) {
            _ if is_damaged => Phase::Failed(Job::<W>::damaged().problem),
            Ok(Some(Outcome::Completed(found))) => Phase::Completed(found),
            Ok(Some(Outcome::Failed(problem))) => Phase::Failed(problem),
            Ok(None) => Phase::Waiting,
            Err(error @ StoreError::Damaged { .. }) => {
                tracing::warn!(job = %id, %error, "the outcome of a job is damaged, so it is begun again");
                Phase::Waiting
            }
            Err(error) => return Err(error),
        };
        let unfinished = matches!(phase, Phase::Waiting);
        // Of a damaged one a person may want to save what was sent.
        if !unfinished && !is_damaged {
            W::forget_input(&self.store, &id);
        }
        // Rather too much than nothing where it cannot be counted.
        let bytes = self.store.bytes(kind, &id).unwrap_or_else(|_| meta.sent_bytes());
        let job = Arc::new(Job::<W>::new(meta, phase, bytes));
        match if unfinished { W::load(&self.store, &job) } else { Ok(()) } {
            Ok(()) => {}
            Err(error @ StoreError::Damaged { .. }) => drop(job.fail_if_damaged(&self.store, error)),
            Err(error) => {
                tracing::error!(job = %id, %error, "the files of a job cannot be read, and are left where they are");
                let detail = format!(
                    "the files of this {} cannot be read; nothing was removed, so have the operator check the disk and restart the service",
                    W::NAME
                );
                job.set_phase(Phase::Failed(ApiError::new(problem::STORAGE_FAILED, detail).problem));
            }
        }
        W::jobs(self).insert(Arc::clone(&job));
        match job.phase().is_final() {
            true => self.resend_undelivered(&job),
            false => Arc::clone(self).begin_job(job),
        }
        Ok(())
    }

    /// Keeps how work on a job ended. Whether the job is over.
    pub(crate) async fn end_job<W: Work>(&self, job: &Arc<Job<W>>, ended: Ended<W::Finished>) -> bool {
        let (outcome, workshop) = match ended {
            Ended::Paused => return false,
            // Its files may be gone, which says nothing of it, unless it cannot be deleted.
            Ended::Failed(_) if job.is_going() => {
                job.set_phase(Phase::Waiting);
                return false;
            }
            Ended::Failed(error) if error.passes => {
                tracing::warn!(job = job.id(), detail = %error.problem.detail, "a job waits");
                job.set_phase(Phase::Waiting);
                return false;
            }
            Ended::Completed(finished, workshop) => (Outcome::Completed(finished), Some(workshop)),
            Ended::Failed(error) if error.status().is_client_error() => {
                tracing::info!(job = job.id(), detail = %error.problem.detail, "a job cannot be done");
                (Outcome::Failed(error.problem), None)
            }
            // Errors that may be temporary are retried after a restart.
            Ended::Failed(error) | Ended::GivenUp(error) => {
                self.fail_job(job, error);
                return true;
            }
        };
        self.finish_job(job, outcome, workshop).await;
        true
    }

    /// Ends a job for this process: a restart begins it again.
    fn fail_job<W: Work>(&self, job: &Job<W>, error: ApiError) {
        job.set_phase(Phase::Failed(error.problem));
        if !self.is_stopped(job) {
            self.announce_unrecorded(job, Event::JobFailed);
        }
    }

    /// Stores the outcome of a job with the results in a workshop, then notifies its followers.
    async fn finish_job<W: Work>(&self, job: &Arc<Job<W>>, outcome: Outcome<W::Finished>, workshop: Option<Workshop>) {
        let (workshop, mut pauses) = (workshop.map(Arc::new), Pauses::new());
        let event = match outcome {
            Outcome::Completed(_) => Event::JobCompleted,
            Outcome::Failed(_) => Event::JobFailed,
        };
        let stored = loop {
            let (store, id, kept, made) = (self.store.clone(), job.id().to_owned(), outcome.clone(), workshop.clone());
            let (webhooks, about) = (Arc::clone(&self.webhooks), job.about());
            let stored = blocking(move || {
                let files = match &kept {
                    Outcome::Completed(finished) => W::files(finished),
                    Outcome::Failed(_) => Cow::default(),
                };
                let results = made.as_deref().map(|workshop| (workshop, &files[..]));
                let due = webhooks.store_pending(&about, event)?;
                store.finish_job(kind_of::<W>(), &id, &kept, results)?;
                W::forget_input(&store, &id);
                Ok::<_, StoreError>((store.bytes(kind_of::<W>(), &id).ok(), due))
            });
            match stored.await {
                Ok(Err(error)) if error.is_passing() && !self.is_stopped(job) => {
                    tracing::warn!(job = job.id(), %error, "the outcome of a job cannot be kept yet");
                    self.pause(job, &mut pauses).await;
                    if !job.settled().await {
                        return;
                    }
                }
                stored => break stored,
            }
        };
        // One that cannot be deleted is over all the same.
        if !job.settled().await {
            return;
        }
        let mut due = None;
        match stored {
            Ok(Ok((bytes, message))) => {
                due = message;
                if let Some(bytes) = bytes {
                    job.bytes.store(bytes, Relaxed);
                }
            }
            Ok(Err(error)) => {
                tracing::warn!(job = job.id(), %error, "the outcome of a job could not be kept; a restart begins it again");
                if matches!(outcome, Outcome::Completed(_)) {
                    return self.fail_job(job, ApiError::from(error));
                }
            }
            Err(error) => return self.fail_job(job, error),
        }
        let (phase, result) = match outcome {
            Outcome::Completed(found) => (Phase::Completed(found), "completed"),
            Outcome::Failed(problem) => (Phase::Failed(problem), "failed"),
        };
        metrics::counter!(W::ENDED, "result" => result).increment(1);
        job.set_phase(phase);
        if let Some(due) = due {
            self.announce(job, due);
        }
    }

    /// Deletes a job and stops its work. Runs to the end even if the client disconnects.
    ///
    /// # Errors
    /// Storage errors.
    pub(crate) async fn delete_job<W: Run>(self: &Arc<Self>, job: &Arc<Job<W>>) -> Result<(), ApiError> {
        let (service, job) = (Arc::clone(self), Arc::clone(job));
        to_the_end(async move {
            let (store, id, kind) = (service.store.clone(), job.id().to_owned(), kind_of::<W>());
            job.deleting.store(true, SeqCst);
            let deleted = blocking(move || store.delete(kind, &id)).await.and_then(|deleted| Ok(deleted?));
            if deleted.is_err() {
                job.deleting.store(false, SeqCst);
                job.touch();
            }
            deleted?;
            W::jobs(&service).remove(job.id());
            job.deleted().cancel();
            job.touch();
            Ok(())
        })
        .await
    }
}
