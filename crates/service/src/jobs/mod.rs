//! Long jobs, whatever they do: created durably, worked on in the background, followed, completed or failed once, kept over restarts, deleted.
//! What a kind of job is and what is known of one lies with it ([`Work`]), as how the service works on it ([`Run`]); nothing here knows HTTP.

mod create;
mod life;
mod registry;
mod results;
mod run;
mod summary;

pub(crate) use create::{Checked, new_job};
pub(crate) use life::Ended;
pub(crate) use registry::Jobs;
pub(crate) use results::{Frames, Piece, ResultsError, Stoppable};
pub(crate) use run::{MAX_ATTEMPTS, Run};

use crate::config::ServeConfig;
use crate::problem::{self, ApiError};
use crate::store::{JobMeta, Kind, RecordMeta as _, Store, StoreError, StoredPart};
use crate::sync::lock;
use cager_proto::job_messages::JobKind;
use cager_proto::messages::Problem;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use std::borrow::Cow;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering::SeqCst};
use std::sync::{Mutex, MutexGuard};
use tokio::sync::watch;
use tokio_util::sync::CancellationToken;

/// A kind of job.
pub(crate) trait Work: Send + Sync + Sized + 'static {
    type Meta: JobMeta;
    /// What is found of a completed job, without its files.
    type Finished: Clone + Serialize + DeserializeOwned + Send + Sync;
    /// What is known of one that is not over, in memory.
    type Progress: Default + Send;

    /// What it is in lists of all kinds.
    const KIND: JobKind;
    /// What one is called, in messages.
    const NAME: &'static str;
    /// Where they are listed.
    const LIST: &'static str;
    /// Counts those that ended, by result.
    const ENDED: &'static str;
    /// The problem of one that failed.
    const FAILED: problem::ProblemKind;
    /// What has to happen before there are results.
    const UNFINISHED: &'static str;
    /// Why a completed one may not have a result.
    const MISSING: &'static str = "it has no such result";
    /// The reason that is counted where too many wait.
    const QUEUE: &'static str;

    /// How many of a tenant's may wait for their turn.
    fn most_waiting(config: &ServeConfig) -> usize;

    /// Whether one waits for its turn.
    fn waits(status: &Status<Self>) -> bool {
        matches!(status.phase, Phase::Waiting)
    }

    /// Whether one that runs has nothing to do, since it waits for its client.
    fn is_idle(_status: &Status<Self>) -> bool {
        false
    }

    /// Files of the results.
    fn files(finished: &Self::Finished) -> Cow<'_, [StoredPart]>;

    /// Reads what is on disk of a job that is not over. Blocks.
    ///
    /// # Errors
    /// It cannot be read.
    fn load(_store: &Store, _job: &Job<Self>) -> Result<(), StoreError> {
        Ok(())
    }

    /// Removes what a job that is over needs no longer, best effort.
    fn forget_input(store: &Store, id: &str);

    /// Adapts the progress to a new phase.
    fn enter(_progress: &mut Self::Progress, _phase: &Phase<Self::Finished>) {}
}

/// Where a job is in its life.
#[derive(Clone)]
pub(crate) enum Phase<F> {
    Waiting,
    Running,
    Completed(Box<F>),
    Failed(Box<Problem>),
}

impl<F> Phase<F> {
    /// Whether nothing changes any more.
    pub(crate) fn is_final(&self) -> bool {
        matches!(self, Self::Completed(_) | Self::Failed(_))
    }
}

/// The stored outcome of a job.
#[derive(Clone, Debug, Deserialize, Serialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum Outcome<F> {
    Completed(Box<F>),
    Failed(Box<Problem>),
}

/// A job in memory.
pub(crate) struct Job<W: Work> {
    pub(crate) meta: W::Meta,
    /// Bytes of its files.
    pub(crate) bytes: AtomicU64,
    status: Mutex<Status<W>>,
    version: watch::Sender<u64>,
    deleted: CancellationToken,
    /// Whether it is being deleted, or is.
    deleting: AtomicBool,
    /// Whether this process has noted that it works on it, which counts as an attempt if the process ends.
    is_counted: AtomicBool,
}

/// State and progress of a job.
pub(crate) struct Status<W: Work> {
    pub(crate) phase: Phase<W::Finished>,
    pub(crate) progress: W::Progress,
}

impl<W: Work> Job<W> {
    pub(crate) fn new(meta: W::Meta, phase: Phase<W::Finished>, bytes: u64) -> Self {
        Self {
            meta,
            bytes: AtomicU64::new(bytes),
            status: Mutex::new(Status { phase, progress: W::Progress::default() }),
            version: watch::Sender::new(0),
            deleted: CancellationToken::new(),
            deleting: AtomicBool::new(false),
            is_counted: AtomicBool::new(false),
        }
    }

    pub(crate) fn id(&self) -> &str {
        self.meta.id()
    }

    /// A counter that changes with every change of the job.
    pub(crate) fn changes(&self) -> watch::Receiver<u64> {
        self.version.subscribe()
    }

    /// Cancelled when the job is deleted.
    pub(crate) fn deleted(&self) -> &CancellationToken {
        &self.deleted
    }

    /// Whether it is being deleted, so that its files may be gone, or is deleted.
    pub(crate) fn is_going(&self) -> bool {
        self.deleting.load(SeqCst)
    }

    /// Tells followers of a change.
    pub(crate) fn touch(&self) {
        self.version.send_modify(|version| *version += 1);
    }

    /// State and progress, locked.
    pub(crate) fn status(&self) -> MutexGuard<'_, Status<W>> {
        lock(&self.status)
    }

    /// The results of a completed job.
    ///
    /// # Errors
    /// It is not completed.
    pub(crate) fn finished(&self) -> Result<Box<W::Finished>, ApiError> {
        match self.phase() {
            Phase::Completed(finished) => Ok(finished),
            Phase::Failed(problem) => Err(ApiError::new(W::FAILED, problem.detail)),
            Phase::Waiting | Phase::Running => Err(ApiError::new(problem::NOT_COMPLETED, W::UNFINISHED).retry_after(2)),
        }
    }

    pub(crate) fn phase(&self) -> Phase<W::Finished> {
        self.status().phase.clone()
    }

    pub(crate) fn set_phase(&self, phase: Phase<W::Finished>) {
        {
            let mut status = self.status();
            W::enter(&mut status.progress, &phase);
            status.phase = phase;
        }
        self.touch();
    }

    /// Takes over progress and tells followers.
    pub(crate) fn progressed(&self, change: impl FnOnce(&mut W::Progress)) {
        change(&mut self.status().progress);
        self.touch();
    }

    /// The failure of a job whose stored data is damaged.
    pub(crate) fn damaged() -> ApiError {
        let detail = format!("stored data of this {} is damaged; send the request again", W::NAME);
        ApiError::new(W::FAILED, detail)
    }

    /// The response for a storage error; damage fails the job, also in the store.
    pub(crate) fn fail_if_damaged(&self, store: &Store, error: StoreError) -> ApiError {
        if self.is_going() {
            return ApiError::new(problem::NOT_FOUND, format!("the {} was deleted", W::NAME));
        }
        let StoreError::Damaged { what, .. } = &error else {
            return error.into();
        };
        let failed = Self::damaged();
        tracing::error!(job = self.id(), %error, "a job is damaged");
        metrics::counter!("cager_quarantined_total").increment(1);
        if let Err(error) = store.mark_damaged(kind_of::<W>(), self.id(), what) {
            tracing::error!(job = self.id(), %error, "the damage could not be noted");
        }
        self.set_phase(Phase::Failed(failed.problem.clone()));
        failed
    }
}

/// Where its jobs lie in the store.
pub(crate) const fn kind_of<W: Work>() -> Kind {
    <W::Meta as crate::store::RecordMeta>::KIND
}
