//! Cage jobs, independent of HTTP: cages designed in the background from example frames, at the lowest priority. A job is queued, running,
//! completed or failed; its input is stored until it has ended, so that a restart can begin it again.

pub(crate) mod create;
mod duplicates;
mod options;
mod run;
pub(crate) mod samples;

pub use run::Designer;
pub(crate) use run::{DesignPool, local_designer};

use crate::config::ServeConfig;
use crate::jobs::{Job, Phase, Work};
use crate::problem::{self, ApiError};
use crate::store::{CAGE, CageJobMeta, Store, StoredPart};
use bytes::Bytes;
use cager_cages::Progress as DesignProgress;
use cager_geometry::mesh::TriMesh;
use cager_proto::cage_messages::{CageError, CageJob as View, CageProgress, CageStage, CageState};
use cager_proto::job_messages::JobKind;
use serde::{Deserialize, Serialize};
use std::borrow::Cow;
use std::time::Instant;

/// Cages designed by example.
pub struct CageDesign;

/// A cage job in memory.
pub(crate) type CageJob = Job<CageDesign>;

impl Work for CageDesign {
    type Meta = CageJobMeta;
    type Finished = Finished;
    type Progress = Progress;

    const KIND: JobKind = JobKind::Cage;
    const NAME: &'static str = "cage design";
    const LIST: &'static str = "/v1/cages";
    const ENDED: &'static str = "cager_designs_total";
    const FAILED: problem::ProblemKind = problem::CAGE_FAILED;
    const UNFINISHED: &'static str = "wait until the cage is designed";
    const QUEUE: &'static str = "design_queue";

    fn most_waiting(config: &ServeConfig) -> usize {
        config.max_design_queue
    }

    fn files(finished: &Finished) -> Cow<'_, [StoredPart]> {
        let Finished { cage_bytes: bytes, cage_digest, .. } = finished;
        vec![StoredPart { name: CAGE.to_owned(), bytes: *bytes, blake3: cage_digest.clone() }].into()
    }

    fn forget_input(store: &Store, id: &str) {
        store.forget_cage_job_input(id);
    }

    fn enter(progress: &mut Progress, phase: &Phase<Finished>) {
        progress.stage = None;
        progress.seconds = progress.seconds();
        progress.began = matches!(phase, Phase::Running).then(Instant::now);
        if !matches!(phase, Phase::Running) {
            progress.best = None;
        }
    }
}

/// Progress of a design.
#[derive(Default)]
pub(crate) struct Progress {
    stage: Option<&'static str>,
    fraction: f64,
    /// Error on the frames that the best cage is chosen by.
    error: Option<f64>,
    /// Number of frames sampled.
    sampled: u32,
    best: Option<Best>,
    began: Option<Instant>,
    /// How long it took, once it has ended.
    seconds: f64,
    timed_out: bool,
}

impl Progress {
    fn seconds(&self) -> f64 {
        self.began.map_or(self.seconds, |began| began.elapsed().as_secs_f64())
    }
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

/// Results of a completed job, without the cage itself.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
pub(crate) struct Finished {
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
    fn set_timed_out(&self) {
        self.status().progress.timed_out = true;
    }

    fn set_sampled(&self, sampled: usize) {
        self.status().progress.sampled = sampled as u32;
    }

    /// Takes over the progress that a design reports.
    fn designed(&self, told: &DesignProgress<'_>) {
        let better = told.better.map(Best::new);
        self.progressed(|progress| {
            progress.stage = Some(told.stage);
            progress.fraction = told.fraction.clamp(0.0, 1.0);
            progress.error = told.error.filter(|error| error.is_finite());
            progress.best = better.or(progress.best.take());
        });
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
        let status = self.status();
        let progress = &status.progress;
        let mut view = View {
            id: self.meta.id.clone(),
            name: self.meta.options.name.clone(),
            state: state_of(&status.phase),
            created: self.meta.created_ms as f64 / 1e3,
            points: self.meta.points,
            frames: self.meta.frame_count,
            sampled_frames: progress.sampled,
            vertices: progress.best.as_ref().map(|best| best.vertices),
            faces: progress.best.as_ref().map(|best| best.faces),
            stage: progress.stage.map(str::to_owned),
            fraction: progress.fraction,
            error: CageError { held_back: progress.error, ..CageError::default() },
            stages: Vec::new(),
            seconds: progress.seconds(),
            timed_out: progress.timed_out,
            warnings: Vec::new(),
            problem: None,
        };
        match &status.phase {
            Phase::Waiting | Phase::Running => {}
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
    /// `CAGE_NOT_READY`, `CAGE_FAILED`; damage, after which the job has failed.
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
    /// `CAGE_NOT_READY`, `CAGE_FAILED`; damage, after which the job has failed.
    pub(crate) fn cage(&self, store: &Store) -> Result<Cage, ApiError> {
        let best = self.status().progress.best.clone();
        match self.phase() {
            Phase::Completed(found) => {
                let obj = store.cage_job_cage(&self.meta.id, found.cage_bytes, &found.cage_digest);
                let obj = obj.map_err(|error| self.fail_if_damaged(store, error))?;
                Ok(Cage::Final { obj: obj.into(), digest: found.cage_digest })
            }
            Phase::Failed(problem) => Err(ApiError::new(problem::CAGE_FAILED, problem.detail)),
            Phase::Waiting | Phase::Running => best
                .map(|Best { obj, digest, .. }| Cage::SoFar { obj, digest })
                .ok_or_else(|| not_ready("there is no cage yet; wait for the first one of the design")),
        }
    }
}

fn not_ready(detail: &str) -> ApiError {
    ApiError::new(problem::CAGE_NOT_READY, detail).retry_after(2)
}

fn state_of(phase: &Phase<Finished>) -> CageState {
    match phase {
        Phase::Waiting => CageState::Queued,
        Phase::Running => CageState::Running,
        Phase::Completed(_) => CageState::Completed,
        Phase::Failed(_) => CageState::Failed,
    }
}
