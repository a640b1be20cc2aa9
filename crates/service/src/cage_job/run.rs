//! Running designs: a limited number at a time, tenants in turn, on threads of the lowest priority.

use super::{Best, CageJob, Finished, options, samples};
use crate::admission::{Budget, Permit};
use crate::config::ServeConfig;
use crate::engine::threads;
use crate::jobs::{MAX_ATTEMPTS, Outcome, Phase};
use crate::preparation::read_part;
use crate::problem::{self, ApiError};
use crate::service::Service;
use crate::store::{Kind, StoreError};
use crate::tasks::blocking;
use cager_cages::{Design, DesignError, DesignOptions, Progress, design};
use cager_geometry::mesh::Model;
use cager_proto::cage_messages::{CageError, CageStage};
use std::ops::ControlFlow;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};
use std::time::{Duration, Instant};

/// How long after its time limit a design is stopped.
const GRACE: Duration = Duration::from_secs(5);

/// Function that designs cages; tests replace it.
pub type Designer = dyn Fn(
        &Model,
        &[Vec<f64>],
        &DesignOptions,
        &mut dyn FnMut(Progress<'_>) -> ControlFlow<()>,
    ) -> Result<Design, DesignError>
    + Send
    + Sync;

/// The design of `cager-cages`.
pub(crate) fn local_designer() -> Arc<Designer> {
    Arc::new(|rest, frames, options, watch| design(rest, frames, None, options, watch))
}

/// Threads and limits of designs.
pub(crate) struct DesignPool {
    places: Arc<Budget>,
    pool: Arc<rayon::ThreadPool>,
    designer: Arc<Designer>,
    /// Memory of sampled frames, in bytes.
    bytes: AtomicU64,
}

impl DesignPool {
    /// Starts the threads that design.
    ///
    /// # Errors
    /// Threads cannot be started.
    pub(crate) fn new(config: &ServeConfig, designer: Arc<Designer>) -> std::io::Result<Self> {
        let pool = Arc::new(threads::pool("design", config.workers, threads::NICE_BACKGROUND)?);
        Ok(Self { places: config.budget(config.max_designs as u64), pool, designer, bytes: AtomicU64::new(0) })
    }

    /// Its threads, for all work that is as little urgent.
    pub(crate) fn threads(&self) -> &rayon::ThreadPool {
        &self.pool
    }

    /// Designs a cage on its threads.
    ///
    /// # Errors
    /// See [`DesignError`].
    pub(crate) fn design(
        &self,
        rest: &Model,
        frames: &[Vec<f64>],
        options: &DesignOptions,
        watch: &mut (dyn FnMut(Progress<'_>) -> ControlFlow<()> + Send),
    ) -> Result<Design, DesignError> {
        self.pool.install(|| (self.designer)(rest, frames, options, &mut |told: Progress<'_>| watch(told)))
    }

    /// Memory of the frames of running designs, in bytes.
    pub(crate) fn bytes(&self) -> u64 {
        self.bytes.load(Relaxed)
    }
}

/// Result of a run.
enum RunOutcome {
    Designed(Box<Finished>, Vec<u8>),
    Failed(ApiError),
    /// The job was deleted or the service is stopping; nothing is stored.
    Stopped,
}

impl Service {
    /// Waits for the job's turn, designs its cage and stores the outcome.
    pub(super) async fn run_cage_job(self: Arc<Self>, job: Arc<CageJob>) {
        let place = loop {
            if let Some(place) = self.wait_for_turn(&job).await {
                break place;
            }
            if job.state().is_final() || job.deleted().is_cancelled() || self.stopping().is_cancelled() {
                return;
            }
        };
        job.set_phase(Phase::Running);
        let (service, running) = (Arc::clone(&self), Arc::clone(&job));
        let ended = blocking(move || service.design(&running, place)).await.unwrap_or_else(RunOutcome::Failed);
        match ended {
            // An orderly stop does not count as an attempt.
            RunOutcome::Stopped => {
                if let Err(error) = self.store.uncount_attempt(Kind::CageJob, &job.meta.id) {
                    tracing::debug!(job = %job.meta.id, %error, "the count of its beginnings stays");
                }
            }
            RunOutcome::Designed(found, cage) => {
                self.finish_cage_job(&job, Outcome::Completed(found), Some(cage)).await;
            }
            RunOutcome::Failed(error) if error.status().is_client_error() => {
                tracing::info!(job = %job.meta.id, detail = %error.problem.detail, "no cage can be designed");
                self.finish_cage_job(&job, Outcome::Failed(error.problem), None).await;
            }
            // Errors that may be temporary are retried after a restart.
            RunOutcome::Failed(error) => job.set_phase(Phase::Failed(error.problem)),
        }
    }

    /// A permit to run; `None` if a job of the same input has to be looked at again, or the job has ended.
    async fn wait_for_turn(&self, job: &Arc<CageJob>) -> Option<Permit> {
        let (tenant, id) = (&job.meta.tenant, Some(job.meta.id.as_str()));
        let duplicate =
            || self.cage_jobs.duplicate(tenant, &job.meta.key, id).filter(|duplicate| !Arc::ptr_eq(duplicate, job));
        let mut unreadable = false;
        if let Some(duplicate) = duplicate() {
            let mut changes = duplicate.changes();
            match duplicate.phase() {
                Phase::Completed(found) if self.copy_outcome(job, &duplicate, found.clone()).await => return None,
                // Its cage could not be read, and it has failed by now.
                Phase::Completed(_) | Phase::Failed(_) => unreadable = true,
                Phase::Waiting | Phase::Running => {
                    tokio::select! {
                        _ = changes.changed() => {}
                        () = duplicate.deleted().cancelled() => {}
                        () = job.deleted().cancelled() => {}
                        () = self.stopping().cancelled() => {}
                    }
                    return None;
                }
            }
        }
        let place = tokio::select! {
            place = self.designs.places.take(tenant, 1) => place,
            () = job.deleted().cancelled() => return None,
            () = self.stopping().cancelled() => return None,
        };
        // A job of the same input may have been completed meanwhile; one that could not be read is not tried again.
        let completed = |duplicate: &Arc<CageJob>| matches!(duplicate.phase(), Phase::Completed(_));
        if !unreadable && duplicate().as_ref().is_some_and(completed) { None } else { Some(place) }
    }

    /// Runs the design of a job. Blocks.
    fn design(&self, job: &Arc<CageJob>, _place: Permit) -> RunOutcome {
        let clock = Instant::now();
        let ended = match self.design_with(job, clock) {
            Ok(_) | Err(_) if job.deleted().is_cancelled() || self.stopping().is_cancelled() => RunOutcome::Stopped,
            Ok((found, cage)) => RunOutcome::Designed(Box::new(found), cage),
            Err(error) => RunOutcome::Failed(error),
        };
        metrics::histogram!("cager_design_seconds").record(clock.elapsed().as_secs_f64());
        ended
    }

    fn design_with(&self, job: &Arc<CageJob>, clock: Instant) -> Result<(Finished, Vec<u8>), ApiError> {
        let meta = &job.meta;
        let damaged = |error: StoreError| job.fail_if_damaged(&self.store, error);
        if self.store.count_attempt(Kind::CageJob, &meta.id).map_err(damaged)? > MAX_ATTEMPTS {
            let detail = format!(
                "the service ended {MAX_ATTEMPTS} times while this cage was designed, so it is given up; try a lighter model, or fewer frames"
            );
            return Err(ApiError::new(problem::INVALID_GEOMETRY, detail));
        }
        let options = options::design_options(&meta.options, self.config.max_design_seconds.max(1))?;
        let rest = read_part("rest", &meta.rest.name, &self.store.cage_job_rest(meta).map_err(damaged)?)?;
        let frames = self.store.cage_job_frames(meta).map_err(damaged)?;
        let bytes = frames.bytes();
        let mut reader = samples::open(&meta.frames.name, frames, bytes, meta.points as usize, meta.options.frames)?;
        let count = samples::sampled(reader.frames(), rest.points.len(), self.config.max_design_bytes);
        let taken = TrackedMemory::new(&self.designs.bytes, 24 * count as u64 * u64::from(meta.points));
        let mut frames = Vec::with_capacity(count);
        samples::read(&mut *reader, count, |_, frame| frames.push(frame.to_vec()))?;
        drop(reader);
        job.set_sampled(count);

        let latest = clock + options.time_limit.unwrap_or_default() + GRACE;
        let mut watch = |told: Progress<'_>| {
            job.designed(&told);
            let over = Instant::now() > latest || job.deleted().is_cancelled() || self.stopping().is_cancelled();
            if over { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        };
        let designed = self.designs.design(&rest, &frames, &options, &mut watch);
        drop((frames, taken));
        let designed = designed.map_err(|error| refused(&error))?;
        let best = Best::new(&designed.cage);
        let found = finished(&designed, &best, count, job.progress().error, clock);
        Ok((found, best.obj.to_vec()))
    }
}

fn finished(designed: &Design, best: &Best, sampled: usize, told: Option<f64>, clock: Instant) -> Finished {
    let finite = |x: f64| Some(x).filter(|x| x.is_finite());
    let stages: Vec<CageStage> = designed
        .stages
        .iter()
        .map(|stage| CageStage {
            name: stage.name.clone(),
            vertices: stage.vertices as u32,
            error: CageError { designed: finite(stage.training_error), held_back: finite(stage.validation_error) },
            condition_number: stage.condition_number.and_then(finite),
            singular: stage.condition_number == Some(f64::INFINITY),
            seconds: stage.seconds,
        })
        .collect();
    Finished {
        vertices: best.vertices,
        faces: best.faces,
        sampled: sampled as u32,
        error: stages.last().map_or(CageError { designed: None, held_back: told }, |stage| stage.error),
        stages,
        seconds: clock.elapsed().as_secs_f64(),
        timed_out: designed.timed_out,
        warnings: designed.warnings.clone(),
        cage_bytes: best.obj.len() as u64,
        cage_digest: best.digest.clone(),
    }
}

/// The response for a failed design.
fn refused(error: &DesignError) -> ApiError {
    use cager_cages::EncloseError::TooFewVertices;
    match error {
        DesignError::Enclose(TooFewVertices { .. }) | DesignError::TooManyVertices { .. } => {
            ApiError::new(problem::INVALID_OPTIONS, format!("vertices: {error}"))
        }
        DesignError::FrameSize { .. } | DesignError::NotFinite { .. } | DesignError::NoFrames => {
            ApiError::new(problem::INVALID_FRAME, format!("frames: {error}"))
        }
        DesignError::Stopped => {
            let detail = "time_limit: there was no cage when the time was over; give more seconds, or try again when the service has less to do";
            ApiError::new(problem::INVALID_OPTIONS, detail)
        }
        _ => ApiError::new(problem::INVALID_GEOMETRY, format!("rest: {error}")),
    }
}

/// Counts memory in use until it is dropped.
struct TrackedMemory<'a> {
    all: &'a AtomicU64,
    bytes: u64,
}

impl<'a> TrackedMemory<'a> {
    fn new(all: &'a AtomicU64, bytes: u64) -> Self {
        all.fetch_add(bytes, Relaxed);
        Self { all, bytes }
    }
}

impl Drop for TrackedMemory<'_> {
    fn drop(&mut self) {
        self.all.fetch_sub(self.bytes, Relaxed);
    }
}
