//! Recoveries, independent of HTTP: a template followed through surfaces as they are sent, in the background. Frames are on disk as they were sent
//! before they are acknowledged; what follows them is `cager recover` itself, which reads them again whenever it needs them. So a restart begins
//! with the first frame and comes to the same results.

mod create;
mod finish;
mod frames;
mod run;
mod source;
mod valid_options;
mod view;

pub(crate) use create::NewRecovery;

use crate::config::ServeConfig;
use crate::jobs::{Job, Phase, Status, Work};
use crate::problem::{self, ApiError};
use crate::store::{RecoveryMeta, Store, StoreError, StoredPart};
use cager_proto::job_messages::JobKind;
use serde::{Deserialize, Serialize};
use std::borrow::Cow;
use std::collections::BTreeMap;
use std::sync::Arc;
use std::sync::atomic::Ordering::Relaxed;

/// Animations recovered from surfaces.
pub(crate) struct Recovery;

/// A recovery in memory.
pub(crate) type RecoveryJob = Job<Recovery>;

impl Work for Recovery {
    type Meta = RecoveryMeta;
    type Finished = Finished;
    type Progress = Progress;

    const KIND: JobKind = JobKind::Recovery;
    const NAME: &'static str = "recovery";
    const LIST: &'static str = "/v1/recoveries";
    const ENDED: &'static str = "cager_recoveries_total";
    const FAILED: problem::ProblemKind = problem::RECOVERY_FAILED;
    const UNFINISHED: &'static str = "results are written when the recovery is completed; post {\"frames\": F} to complete, and wait until its state is completed";
    const MISSING: &'static str =
        "there are joints where a rig and a manifold were sent; make the recovery anew with them";
    const QUEUE: &'static str = "recovery_queue";

    fn most_waiting(config: &ServeConfig) -> usize {
        config.max_recovery_queue
    }

    fn waits(status: &Status<Self>) -> bool {
        !status.phase.is_final() && status.progress.has_work()
    }

    fn is_idle(status: &Status<Self>) -> bool {
        !status.progress.has_work()
    }

    fn files(finished: &Finished) -> Cow<'_, [StoredPart]> {
        (&finished.files).into()
    }

    fn load(store: &Store, job: &RecoveryJob) -> Result<(), StoreError> {
        let (frames, declared) = (store.recovery_frames(job.id())?, store.declared_recovery(job.id())?);
        // Small frames count as much as when they came.
        let more = frames.iter().map(|(_, part)| frames::counted_bytes(part) - part.bytes).sum();
        job.bytes.fetch_add(more, Relaxed);
        job.progressed(|progress| {
            progress.declared = declared;
            progress.frames = frames.into_iter().collect();
            progress.count();
        });
        Ok(())
    }

    fn forget_input(store: &Store, id: &str) {
        store.forget_recovery_input(id);
    }

    fn enter(progress: &mut Progress, phase: &Phase<Finished>) {
        if phase.is_final() {
            progress.received = progress.frames.len() as u32;
            progress.frames = BTreeMap::new();
            // What followers have not heard yet; cages are in a file then.
            progress.followed.iter_mut().for_each(|followed| followed.cage = Vec::new());
        }
    }
}

/// What is known of a recovery that is not over.
#[derive(Default)]
pub(crate) struct Progress {
    /// Frames that are on disk.
    frames: BTreeMap<u32, StoredPart>,
    /// How many there were when it was over, and kept its frames in mind no longer.
    received: u32,
    /// How many are there from the first on without a gap.
    arrived: u32,
    /// How many there are in all, once it was said.
    declared: Option<u32>,
    /// What the first pass found, from the first frame on.
    followed: Vec<FollowedCage>,
    refined: u32,
    /// Held while a frame is stored or their number is noted.
    storing: Arc<tokio::sync::Mutex<()>>,
}

impl Progress {
    /// Notes how many frames have arrived without a gap.
    fn count(&mut self) {
        while self.frames.contains_key(&self.arrived) {
            self.arrived += 1;
        }
    }

    /// Whether there is something to do now.
    fn has_work(&self) -> bool {
        self.arrived as usize > self.followed.len() || self.declared.is_some()
    }
}

/// A frame as the first pass found it.
struct FollowedCage {
    cage: Vec<[f32; 3]>,
    joints: Vec<[f64; 3]>,
    score: Option<f64>,
    outcome: &'static str,
}

/// Results of a completed recovery, without its files.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
pub(crate) struct Finished {
    pub(crate) frames: u32,
    pub(crate) lost: u32,
    pub(crate) cage_vertices: u32,
    pub(crate) warnings: Vec<String>,
    /// The results.
    pub(crate) files: Vec<StoredPart>,
}

/// A recovery that takes no frames any more, or is gone.
fn closed(job: &RecoveryJob) -> Option<ApiError> {
    if job.is_going() {
        return Some(ApiError::new(problem::NOT_FOUND, "the recovery was deleted"));
    }
    match job.phase() {
        Phase::Completed(finished) => {
            let detail = format!("the recovery is completed with {} frames and takes no more", finished.frames);
            Some(ApiError::new(problem::RECOVERY_COMPLETED, detail))
        }
        Phase::Failed(problem) => {
            Some(ApiError::new(problem::RECOVERY_FAILED, format!("the recovery failed: {}", problem.detail)))
        }
        Phase::Waiting | Phase::Running => None,
    }
}
