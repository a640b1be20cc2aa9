//! Cage jobs, independent of HTTP: cages designed in the background from example frames, at the lowest priority. A job is queued, running,
//! completed or failed; its input is stored until it has ended, so that a restart can begin it again.

pub(crate) mod create;
mod options;
pub(crate) mod registry;
mod run;
mod samples;

pub use run::Designer;
pub(crate) use run::{DesignPool, local_designer};

use crate::problem::{self, ApiError};
use crate::store::{CageJobMeta, Kind, Store, StoreError};
use crate::sync::lock;
use bytes::Bytes;
use cager_cages::Progress as DesignProgress;
use cager_geometry::mesh::TriMesh;
use cager_proto::cage_messages::{CageError, CageJob as View, CageProgress, CageStage, CageState};
use cager_proto::messages::Problem;
use serde::{Deserialize, Serialize};
use std::sync::Mutex;
use std::sync::atomic::AtomicU64;
use std::time::Instant;
use tokio::sync::watch;
use tokio_util::sync::CancellationToken;

/// A cage job in memory.
pub(crate) struct CageJob {
    pub(crate) meta: CageJobMeta,
    status: Mutex<Status>,
    /// Bytes of its files.
    pub(crate) bytes: AtomicU64,
    version: watch::Sender<u64>,
    deleted: CancellationToken,
}

/// State and progress of a job.
#[derive(Default)]
struct Status {
    phase: Phase,
    stage: Option<&'static str>,
    fraction: f64,
    /// Error on the held-back frames.
    error: Option<f64>,
    /// Number of frames sampled.
    sampled: u32,
    best: Option<Best>,
    began: Option<Instant>,
}

#[derive(Clone, Default)]
enum Phase {
    #[default]
    Queued,
    Running,
    Completed(Box<Finished>),
    Failed(Box<Problem>),
}

/// The best cage so far of a running design.
#[derive(Clone)]
struct Best {
    obj: Bytes,
    digest: String,
    vertices: u32,
    faces: u32,
}

impl Best {
    fn new(mesh: &TriMesh) -> Self {
        let obj = crate::preparation::obj_of(mesh);
        let digest = blake3::hash(&obj).to_hex().to_string();
        Self { obj: obj.into(), digest, vertices: mesh.vertices.len() as u32, faces: mesh.triangles.len() as u32 }
    }
}

/// The stored outcome of a job.
#[derive(Clone, Debug, Deserialize, Serialize)]
#[serde(rename_all = "snake_case")]
enum Outcome {
    Completed(Box<Finished>),
    Failed(Box<Problem>),
}

/// Results of a completed job, without the cage itself.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
struct Finished {
    vertices: u32,
    faces: u32,
    sampled: u32,
    error: CageError,
    stages: Vec<CageStage>,
    seconds: f64,
    timed_out: bool,
    warnings: Vec<String>,
    cage_bytes: u64,
    cage_digest: String,
}

/// The cage of a job.
pub(crate) enum Cage {
    /// The best so far; a better one may follow.
    SoFar { obj: Bytes, digest: String },
    /// The result.
    Final { obj: Bytes, digest: String },
}

impl CageJob {
    fn new(meta: CageJobMeta, phase: Phase, bytes: u64) -> Self {
        Self {
            meta,
            status: Mutex::new(Status { phase, ..Status::default() }),
            bytes: AtomicU64::new(bytes),
            version: watch::Sender::new(0),
            deleted: CancellationToken::new(),
        }
    }

    /// A counter that changes with every change of the job.
    pub(crate) fn changes(&self) -> watch::Receiver<u64> {
        self.version.subscribe()
    }

    /// Cancelled when the job is deleted.
    pub(crate) fn deleted(&self) -> &CancellationToken {
        &self.deleted
    }

    fn touch(&self) {
        self.version.send_modify(|version| *version += 1);
    }

    fn set_phase(&self, phase: Phase) {
        {
            let mut status = lock(&self.status);
            status.stage = None;
            status.began = matches!(phase, Phase::Running).then(Instant::now);
            if !matches!(phase, Phase::Running) {
                status.best = None;
            }
            status.phase = phase;
        }
        self.touch();
    }

    fn phase(&self) -> Phase {
        lock(&self.status).phase.clone()
    }

    /// State of the job.
    pub(crate) fn state(&self) -> CageState {
        state_of(&lock(&self.status).phase)
    }

    fn set_sampled(&self, sampled: usize) {
        lock(&self.status).sampled = sampled as u32;
    }

    /// Takes over the progress that a design reports.
    fn progressed(&self, told: &DesignProgress<'_>) {
        let better = told.better.map(Best::new);
        {
            let mut status = lock(&self.status);
            status.stage = Some(told.stage);
            status.fraction = told.fraction.clamp(0.0, 1.0);
            status.error = told.error.filter(|error| error.is_finite());
            status.best = better.or(status.best.take());
        }
        self.touch();
    }

    /// State and progress, for server-sent events.
    pub(crate) fn progress(&self) -> CageProgress {
        let view = self.view();
        CageProgress {
            state: view.state,
            stage: view.stage,
            fraction: view.fraction,
            vertices: view.vertices,
            error: view.error.held_back,
        }
    }

    /// The job as returned by the API.
    pub(crate) fn view(&self) -> View {
        let status = lock(&self.status);
        let mut view = View {
            id: self.meta.id.clone(),
            name: self.meta.options.name.clone(),
            state: state_of(&status.phase),
            created: self.meta.created_ms as f64 / 1e3,
            points: self.meta.points,
            frames: self.meta.frame_count,
            sampled_frames: status.sampled,
            vertices: status.best.as_ref().map(|best| best.vertices),
            faces: status.best.as_ref().map(|best| best.faces),
            stage: status.stage.map(str::to_owned),
            fraction: status.fraction,
            error: CageError { designed: None, held_back: status.error },
            stages: Vec::new(),
            seconds: status.began.map_or(0.0, |began| began.elapsed().as_secs_f64()),
            timed_out: false,
            warnings: Vec::new(),
            problem: None,
        };
        match &status.phase {
            Phase::Queued | Phase::Running => {}
            Phase::Completed(found) => {
                view.sampled_frames = found.sampled;
                (view.vertices, view.faces) = (Some(found.vertices), Some(found.faces));
                (view.fraction, view.error, view.seconds) = (1.0, found.error, found.seconds);
                (view.stages, view.timed_out) = (found.stages.clone(), found.timed_out);
                view.warnings = found.warnings.clone();
            }
            Phase::Failed(problem) => view.problem = Some((**problem).clone()),
        }
        view
    }

    /// The cage of a completed job. Blocks.
    ///
    /// # Errors
    /// `CAGE_NOT_READY`, `CAGE_FAILED`; damage, after which the job has failed and is in quarantine.
    pub(crate) fn completed_cage(&self, store: &Store) -> Result<Bytes, ApiError> {
        match self.cage(store)? {
            Cage::Final { obj, .. } => Ok(obj),
            Cage::SoFar { .. } => Err(not_ready(
                "the cage is still being designed; wait until it is completed, or send the best so far as the part cage: GET …/cage.obj",
            )),
        }
    }

    /// The best cage there is. Blocks.
    ///
    /// # Errors
    /// `CAGE_NOT_READY`, `CAGE_FAILED`; damage, after which the job has failed and is in quarantine.
    pub(crate) fn cage(&self, store: &Store) -> Result<Cage, ApiError> {
        let best = lock(&self.status).best.clone();
        match self.phase() {
            Phase::Completed(found) => {
                let obj = store.cage_job_cage(&self.meta.id, found.cage_bytes, &found.cage_digest);
                let obj = obj.map_err(|error| self.fail_if_damaged(store, error))?;
                Ok(Cage::Final { obj: obj.into(), digest: found.cage_digest })
            }
            Phase::Failed(problem) => Err(ApiError::new(problem::CAGE_FAILED, problem.detail)),
            Phase::Queued | Phase::Running => best
                .map(|Best { obj, digest, .. }| Cage::SoFar { obj, digest })
                .ok_or_else(|| not_ready("there is no cage yet; wait for the first one of the design")),
        }
    }

    /// The response for a storage error; damage fails the job and quarantines it.
    fn fail_if_damaged(&self, store: &Store, error: StoreError) -> ApiError {
        if self.deleted.is_cancelled() {
            return ApiError::new(problem::NOT_FOUND, "the cage design was deleted");
        }
        let StoreError::Damaged { what, .. } = &error else {
            return error.into();
        };
        let failed = ApiError::new(
            problem::CAGE_FAILED,
            "stored data of this design is damaged and was moved to quarantine; request the design again",
        );
        tracing::error!(job = %self.meta.id, %error, "a cage job is damaged and put in quarantine");
        metrics::counter!("cager_quarantined_total").increment(1);
        if let Err(error) = store.quarantine(Kind::CageJob, &self.meta.id, what) {
            tracing::error!(job = %self.meta.id, %error, "it could not be moved");
        }
        self.set_phase(Phase::Failed(failed.problem.clone()));
        failed
    }
}

fn not_ready(detail: &str) -> ApiError {
    ApiError::new(problem::CAGE_NOT_READY, detail).retry_after(2)
}

fn state_of(phase: &Phase) -> CageState {
    match phase {
        Phase::Queued => CageState::Queued,
        Phase::Running => CageState::Running,
        Phase::Completed(_) => CageState::Completed,
        Phase::Failed(_) => CageState::Failed,
    }
}
