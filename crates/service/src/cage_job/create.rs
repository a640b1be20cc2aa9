//! Creating, resuming and deleting cage jobs.

use super::{CageDesign, CageJob, Finished, options, samples};
use crate::admission::Permit;
use crate::auth::Tenant;
use crate::config::ServeConfig;
use crate::idempotency::{extension, fingerprint};
use crate::jobs::{Checked, Ended, Outcome, Phase, new_job};
use crate::preparation::{Reach, check_extent, read_part};
use crate::problem::{self, ApiError};
use crate::service::Service;
use crate::session::registry::Reserved;
use crate::store::{CAGE, CageJobMeta, ContentKey, Idempotency, Spool, Store, StoreError, StoredPart, Workshop};
use crate::tasks::blocking;
use crate::webhooks::Event;
use cager_geometry::mesh::diagonal;
use cager_proto::cage_messages::CageOptions;
use std::sync::Arc;

/// A request to design a cage.
pub(crate) struct NewCageJob {
    pub(crate) rest_name: String,
    pub(crate) rest: Vec<u8>,
    pub(crate) frames_name: String,
    pub(crate) frames: Spool,
    pub(crate) options: CageOptions,
    pub(crate) idempotency_key: Option<String>,
    /// Permit for the memory of the rest pose.
    pub(crate) room: Permit,
    /// Quota reserved for rest pose and frames.
    pub(crate) reserved: Reserved,
}

impl Service {
    /// Creates a job, durably, and queues it. Its input is looked at only as long as the client waits; from then on it runs to the end even if
    /// the client disconnects.
    ///
    /// # Errors
    /// Input that cannot be used, a quota or a queue that is full, and storage errors.
    pub(crate) async fn create_cage_job(
        self: &Arc<Self>,
        tenant: &Arc<Tenant>,
        new: NewCageJob,
    ) -> Result<Arc<CageJob>, ApiError> {
        let (new, rest) = blocking(move || {
            let rest = StoredPart::of(&new.rest_name, &new.rest);
            (new, rest)
        })
        .await?;
        let frames = new.frames.digest().to_hex().to_string();
        let frames = StoredPart { name: new.frames_name.clone(), bytes: new.frames.bytes(), blake3: frames };
        let sent = (new.options.clone(), rest.blake3.clone(), frames.blake3.clone());
        let may_be = move |job: &CageJob| {
            let CageJobMeta { options, rest, frames, .. } = &job.meta;
            (options, &rest.blake3, &frames.blake3) == (&sent.0, &sent.1, &sent.2)
        };
        self.create_job(tenant, (new, [rest, frames]), |(new, _)| request_of(new), may_be, check).await
    }

    /// Creates a job with the outcome of a completed one of the same input, where there is one that can be read.
    pub(super) async fn create_finished(&self, meta: &CageJobMeta) -> Option<Arc<CageJob>> {
        let duplicate = self.cage_jobs.duplicate(&meta.tenant, &meta.key, None)?;
        let Phase::Completed(found) = duplicate.phase() else { return None };
        let (store, kept, finished) = (self.store.clone(), meta.clone(), found.clone());
        let stored = blocking(move || {
            let cage = duplicate.completed_cage(&store).ok()?;
            store.create_finished_cage_job(&kept, &Outcome::Completed(finished), &cage).ok()
        });
        stored.await.ok()??;
        let job = Arc::new(CageJob::new(meta.clone(), Phase::Completed(found.clone()), found.cage_bytes));
        self.cage_jobs.insert(Arc::clone(&job));
        metrics::counter!("cager_designs_total", "result" => "known").increment(1);
        self.announce_unrecorded(&job, Event::JobCompleted);
        Some(job)
    }

    /// Copies the outcome of a job of the same input; false if it cannot be read.
    pub(super) async fn copy_outcome(
        &self,
        job: &Arc<CageJob>,
        duplicate: &Arc<CageJob>,
        found: Box<Finished>,
    ) -> bool {
        let (store, duplicate) = (self.store.clone(), Arc::clone(duplicate));
        let copied = blocking(move || duplicate.completed_cage(&store).map(|cage| workshop_with(&store, &cage)));
        let Ok(Ok(copied)) = copied.await else { return false };
        let ended = copied.map_or_else(|error| Ended::Failed(error.into()), |copy| Ended::Completed(found, copy));
        self.end_job(job, ended).await
    }
}

/// A workshop with a cage, ready to be a job's result. Blocks.
pub(super) fn workshop_with(store: &Store, cage: &[u8]) -> Result<Workshop, StoreError> {
    let workshop = store.workshop()?;
    workshop.write(CAGE, cage).map(|()| workshop)
}

/// The request with an idempotency key that this input is. Blocks.
fn request_of(new: &NewCageJob) -> Option<Idempotency> {
    let (rest, frames) = (extension(&new.rest_name), extension(&new.frames_name));
    let digest = new.frames.digest();
    let parts: [&[u8]; 4] = [rest.as_bytes(), &new.rest, frames.as_bytes(), digest.as_bytes()];
    fingerprint(new.idempotency_key.clone(), parts, &new.options)
}

/// Checks options alone.
///
/// # Errors
/// An option that is out of range, not available, or contradicts another.
pub(crate) fn check_options(options: &CageOptions, config: &ServeConfig) -> Result<(), ApiError> {
    options::design_options(options, config.max_design_seconds).map(|_| ())
}

/// Validates rest pose and sampled frames, so that errors are reported in the response. Blocks.
fn check(
    service: &Service,
    tenant: &Tenant,
    (new, [rest_part, frames_part]): (NewCageJob, [StoredPart; 2]),
    idempotency: Option<Idempotency>,
) -> Result<Checked<CageDesign>, ApiError> {
    let (max_seconds, max_bytes) = (service.config.max_design_seconds, service.config.max_design_bytes);
    let design = options::design_options(&new.options, max_seconds)?;
    let rest = read_part("rest", &new.rest_name, &new.rest)?;
    check_extent("rest", &rest)?;
    let points = rest.points.len();
    let reach = Reach::around(&rest.points, diagonal(&rest.points));
    drop(rest);
    let frames = &new.frames;
    let mut reader = samples::open(&new.frames_name, frames.stored(), frames.bytes(), points, new.options.frames)?;
    let frame_count = u32::try_from(reader.frames())
        .map_err(|_| ApiError::new(problem::INVALID_FRAME, "frames: there are more than 4294967295; send fewer"))?;
    let count = samples::sampled(reader.frames(), points, max_bytes);
    if count < reader.frames().min(2) {
        let detail = format!(
            "two frames of {points} points take more memory than the {max_bytes} bytes that a design may; use a lighter model"
        );
        return Err(ApiError::new(problem::INVALID_GEOMETRY, detail).limit(max_bytes));
    }
    let mut far = None;
    samples::read(&mut *reader, count, |frame, points| {
        far = far.take().or_else(|| Some((frame, reach.refusal(frame as u64, frame == 0, "point", points)?)));
    })?;
    if let Some((frame, detail)) = far {
        let frame = u32::try_from(frame).unwrap_or(u32::MAX);
        return Err(ApiError::new(problem::INVALID_FRAME, detail).frame(frame));
    }
    let key = ContentKey::of([
        format!("cage design {design:?} {points} {frame_count} {count}").as_bytes(),
        tenant.name.as_bytes(),
        extension(&new.rest_name).as_bytes(),
        blake3::hash(&new.rest).as_bytes().as_slice(),
        extension(&new.frames_name).as_bytes(),
        frames.digest().as_bytes(),
    ]);
    drop(reader);
    let NewCageJob { rest, frames, options, room, reserved, .. } = new;
    let (id, created_ms) = new_job();
    let meta = CageJobMeta {
        id,
        tenant: tenant.name.clone(),
        created_ms,
        key,
        options,
        points: points as u32,
        frame_count,
        rest: rest_part,
        frames: frames_part,
        idempotency,
    };
    let unreserved = meta.rest.bytes;
    let store = Box::new(move |store: &Store, meta: &CageJobMeta| store.create_cage_job(meta, &rest, frames));
    Ok(Checked { meta, store, room, reserved: Some(reserved), unreserved })
}
