//! Work on a job: when its turn comes, unless it has ended the process again and again, to its end or to the service's.

use super::{Ended, Job, Jobs, Phase, Work, kind_of};
use crate::admission::{Budget, Permit};
use crate::problem::ApiError;
use crate::service::Service;
use crate::store::{JobMeta as _, Workshop};
use crate::tasks::blocking;
use std::sync::Arc;

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

    /// Works on a job to its end, in the background.
    fn begin(service: Arc<Service>, job: Arc<Job<Self>>);
}

impl Service {
    /// Whether the work on a job is to stop.
    pub(crate) fn is_stopped<W: Work>(&self, job: &Job<W>) -> bool {
        job.deleted().is_cancelled() || self.stopping().is_cancelled()
    }

    /// Waits until it is the turn of a job; nothing where it is deleted before, or the service stops.
    pub(crate) async fn turn<W: Work>(&self, job: &Job<W>, places: &Arc<Budget>) -> Option<Permit> {
        tokio::select! {
            place = places.take(job.meta.tenant(), 1) => Some(place),
            () = job.deleted().cancelled() => None,
            () = self.stopping().cancelled() => None,
        }
    }

    /// Works on a job in its place, by `work`, which blocks, and keeps how that ended.
    pub(crate) async fn run_job<W: Run>(
        self: Arc<Self>,
        job: Arc<Job<W>>,
        place: Permit,
        work: impl FnOnce(&Self, &Job<W>) -> Ended<W::Finished> + Send + 'static,
    ) {
        job.set_phase(Phase::Running);
        let (service, running) = (Arc::clone(&self), Arc::clone(&job));
        let ended = blocking(move || {
            let _place = place;
            work(&service, &running)
        });
        self.end_job(&job, ended.await.unwrap_or_else(Ended::Failed)).await;
    }

    /// Makes the results of a job by `work`, or ends it as `given_up` says where that has ended the process too often. Blocks.
    pub(crate) fn attempt<W: Work>(
        &self,
        job: &Job<W>,
        given_up: impl FnOnce() -> Ended<W::Finished>,
        work: impl FnOnce() -> Result<(W::Finished, Workshop), ApiError>,
    ) -> Ended<W::Finished> {
        let (kind, id) = (kind_of::<W>(), job.id());
        match self.store.count_attempt(kind, id) {
            Ok(attempts) if attempts > MAX_ATTEMPTS => return given_up(),
            Ok(_) => {}
            Err(_) if self.is_stopped(job) => return Ended::Paused,
            Err(error) => return Ended::Failed(job.fail_if_damaged(&self.store, error)),
        }
        let ended = work();
        if !self.is_stopped(job) {
            return ended.map_or_else(Ended::Failed, |(found, workshop)| Ended::Completed(Box::new(found), workshop));
        }
        // An orderly stop does not count as an attempt.
        if let Err(error) = self.store.uncount_attempt(kind, id) {
            tracing::debug!(job = id, %error, "the count of its beginnings stays");
        }
        Ended::Paused
    }
}
