//! Running designs: a limited number at a time, tenants in turn, on threads of low priority.

use super::create::workshop_with;
use super::{Best, CageDesign, CageJob, Finished, options, samples};
use crate::admission::{Budget, Permit};
use crate::config::ServeConfig;
use crate::engine::threads;
use crate::jobs::{Ended, Jobs, MAX_ATTEMPTS, Phase, Run};
use crate::preparation::read_part;
use crate::problem::{self, ApiError};
use crate::service::Service;
use crate::store::{CageJobMeta, StoreError, Workshop};
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

impl Run for CageDesign {
    fn jobs(service: &Service) -> &Arc<Jobs<Self>> {
        &service.cage_jobs
    }

    async fn known(service: &Arc<Service>, meta: &CageJobMeta) -> Option<Arc<CageJob>> {
        service.create_finished(meta).await
    }

    fn turn(service: &Service, job: &Arc<CageJob>) -> impl Future<Output = Option<Permit>> + Send {
        service.wait_for_turn(job)
    }

    fn work(service: &Arc<Service>, job: &Arc<CageJob>, _place: Permit) -> Ended<Finished> {
        service.design(job)
    }
}

impl Service {
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
        let place = self.place(job, &self.designs.places).await?;
        // A job of the same input may have been completed meanwhile; one that could not be read is not tried again.
        let completed = |duplicate: &Arc<CageJob>| matches!(duplicate.phase(), Phase::Completed(_));
        if !unreadable && duplicate().as_ref().is_some_and(completed) { None } else { Some(place) }
    }

    /// Runs the design of a job. Blocks.
    fn design(&self, job: &CageJob) -> Ended<Finished> {
        let clock = Instant::now();
        let given_up = || {
            let detail = format!(
                "the service ended {MAX_ATTEMPTS} times while this cage was designed, so it is given up; try a lighter model, or fewer frames"
            );
            Ended::Failed(ApiError::new(problem::INVALID_GEOMETRY, detail))
        };
        let ended = self.attempt(job, given_up, || self.designed(job, clock));
        metrics::histogram!("cager_design_seconds").record(clock.elapsed().as_secs_f64());
        ended
    }

    fn designed(&self, job: &CageJob, clock: Instant) -> Result<(Finished, Workshop), ApiError> {
        let meta = &job.meta;
        let damaged = |error: StoreError| job.fail_if_damaged(&self.store, error);
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
            if Instant::now() > latest || self.is_stopped(job) {
                ControlFlow::Break(())
            } else {
                ControlFlow::Continue(())
            }
        };
        let designed = self.designs.design(&rest, &frames, &options, &mut watch);
        drop((frames, taken));
        let designed = designed.map_err(|error| {
            if matches!(error, DesignError::Stopped) {
                job.set_timed_out();
            }
            refused(&error)
        })?;
        let best = Best::new(&designed.cage);
        let found = finished(&designed, &best, count, job.progress().error, clock);
        Ok((found, workshop_with(&self.store, &best.obj)?))
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
            error: CageError {
                designed: finite(stage.training_error),
                held_back: finite(stage.validation_error),
                unseen: None,
            },
            condition_number: stage.condition_number.and_then(finite),
            singular: stage.condition_number == Some(f64::INFINITY),
            seconds: stage.seconds,
        })
        .collect();
    Finished {
        vertices: best.vertices,
        faces: best.faces,
        sampled: sampled as u32,
        error: CageError {
            unseen: designed.unseen.as_ref().and_then(|unseen| finite(unseen.error)),
            ..stages.last().map_or(CageError { held_back: told, ..CageError::default() }, |stage| stage.error)
        },
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
            let detail = "there was no cage when the time was over; try again when the service has less to do, or give more seconds";
            ApiError::new(problem::BUSY, detail)
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
