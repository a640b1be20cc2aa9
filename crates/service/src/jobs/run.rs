//! Work on a job: when its turn comes, unless it has ended the process again and again, to its end or to the
//! service's. A store that is away holds it up,
//! and does not end it.

use super::{Ended, Job, Jobs, Phase, Work, kind_of};
use crate::admission::{Budget, Permit};
use crate::problem::ApiError;
use crate::service::Service;
use crate::store::{JobMeta as _, StoreError, Workshop};
use crate::tasks::{Pauses, blocking};
use std::sync::Arc;
use std::sync::atomic::Ordering::SeqCst;

/// Number of attempts after which a job is given up, since it may be what crashes the process.
pub(crate) const MAX_ATTEMPTS: u32 = 5;

/// A kind of job as the service works on it.
pub(crate) trait Run: Work {
    /// All jobs of the kind.
    fn jobs(service: &Service) -> &Arc<Jobs<Self>>;

    /// A completed job like the one to be created, where its results are known already.
    fn known(_service: &Arc<Service>, _meta: &Self::Meta) -> impl Future<Output = Option<Arc<Job<Self>>>> + Send {
        std::future::ready(None)
    }

    /// A place to work on a job when it is its turn; none where it has ended meanwhile, or has to be looked at again.
    fn turn(service: &Service, job: &Arc<Job<Self>>) -> impl Future<Output = Option<Permit>> + Send;

    /// Works on a job in its place until it ends or has to wait. Blocks.
    fn work(service: &Arc<Service>, job: &Arc<Job<Self>>, place: Permit) -> Ended<Self::Finished>;
}

impl Service {
    /// Whether the work on a job is to stop.
    pub(crate) fn is_stopped<W: Work>(&self, job: &Job<W>) -> bool {
        job.deleted().is_cancelled() || self.stopping().is_cancelled()
    }

    /// Waits for a place to work on a job; nothing where it is deleted before, or the service stops.
    pub(crate) async fn place<W: Work>(&self, job: &Job<W>, places: &Arc<Budget>) -> Option<Permit> {
        tokio::select! {
            place = places.take(job.meta.tenant(), 1) => Some(place),
            () = job.deleted().cancelled() => None,
            () = self.stopping().cancelled() => None,
        }
    }

    /// Works on a job to its end, in the background. While the store is away it waits.
    pub(crate) fn begin_job<W: Run>(self: Arc<Self>, job: Arc<Job<W>>) {
        tokio::spawn(async move {
            let mut pauses = Pauses::new();
            while !job.phase().is_final() && !self.is_stopped(&job) {
                // Where it cannot be deleted it goes on.
                if !job.settled().await {
                    return;
                }
                let Some(place) = W::turn(&self, &job).await else { continue };
                let (service, working) = (Arc::clone(&self), Arc::clone(&job));
                let ended = blocking(move || W::work(&service, &working, place)).await.unwrap_or_else(Ended::Failed);
                let is_held_up = ended.is_held_up();
                if self.end_job(&job, ended).await {
                    return;
                }
                if is_held_up {
                    self.pause(&job, &mut pauses).await;
                } else {
                    pauses = Pauses::new();
                }
            }
        });
    }

    /// A pause before what the store held up is tried again, unless the job is deleted or the service stops.
    pub(super) async fn pause<W: Work>(&self, job: &Job<W>, pauses: &mut Pauses) {
        tokio::select! {
            () = pauses.next() => {}
            () = job.deleted().cancelled() => {}
            () = self.stopping().cancelled() => {}
        }
    }

    /// Makes the results of a job by `work`, or ends it as `given_up` says where that has ended the process too often. Blocks.
    pub(crate) fn attempt<W: Work>(
        &self,
        job: &Job<W>,
        given_up: impl FnOnce() -> Ended<W::Finished>,
        work: impl FnOnce() -> Result<(W::Finished, Workshop), ApiError>,
    ) -> Ended<W::Finished> {
        match self.begin_attempt(job) {
            Ok(true) => {}
            Ok(false) => return given_up(),
            Err(_) if self.is_stopped(job) || job.is_going() => return Ended::Paused,
            Err(error) => return Ended::Failed(job.fail_if_damaged(&self.store, error)),
        }
        job.set_phase(Phase::Running);
        let ended = work().map_or_else(Ended::Failed, |(found, workshop)| Ended::Completed(Box::new(found), workshop));
        let is_stopped = self.is_stopped(job);
        if is_stopped || ended.is_held_up() {
            self.end_attempt(job, |before| before.saturating_sub(1));
        }
        if is_stopped { Ended::Paused } else { ended }
    }

    /// Notes durably that work on a job begins, unless that is noted. Whether it may: not where it has ended the
    /// process too often. Blocks.
    ///
    /// # Errors
    /// Those of the store.
    pub(crate) fn begin_attempt<W: Work>(&self, job: &Job<W>) -> Result<bool, StoreError> {
        if job.is_counted.load(SeqCst) {
            return Ok(true);
        }
        let attempts = self.store.count_attempt(kind_of::<W>(), job.id())?;
        job.is_counted.store(true, SeqCst);
        Ok(attempts <= MAX_ATTEMPTS)
    }

    /// Notes that work on a job is not what would end the process now: its attempts are as many as `count` makes of
    /// them. Blocks.
    pub(crate) fn end_attempt<W: Work>(&self, job: &Job<W>, count: impl FnOnce(u32) -> u32) {
        if !job.is_counted.load(SeqCst) {
            return;
        }
        match self.store.set_attempts(kind_of::<W>(), job.id(), count) {
            Ok(_) => job.is_counted.store(false, SeqCst),
            // It stays noted, and is not noted again.
            Err(error) => tracing::debug!(job = job.id(), %error, "the count of its beginnings stays"),
        }
    }
}

impl<W: Work> Job<W> {
    /// Waits while it is being deleted. Whether it is still there.
    pub(super) async fn settled(&self) -> bool {
        let mut changes = self.changes();
        loop {
            changes.mark_unchanged();
            if !self.is_going() {
                return true;
            }
            tokio::select! {
                () = self.deleted().cancelled() => return false,
                _ = changes.changed() => {}
            }
        }
    }

    /// Work on it got further than ever before, and attempts count from 0 by what the store was told.
    pub(crate) fn forget_attempts(&self) {
        self.is_counted.store(false, SeqCst);
    }
}
