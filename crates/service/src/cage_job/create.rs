//! Creating, resuming and deleting cage jobs.

use super::{CageJob, Finished, options, samples};
use crate::admission::Permit;
use crate::auth::Tenant;
use crate::config::ServeConfig;
use crate::idempotency::{extension, fingerprint};
use crate::jobs::{Outcome, Phase, new_job};
use crate::preparation::{check_extent, read_part};
use crate::problem::{self, ApiError};
use crate::service::Service;
use crate::session::registry::Reserved;
use crate::store::{CageJobMeta, ContentKey, Idempotency, Spool, Store, StoredPart};
use crate::tasks::blocking;
use cager_capture::reach::Reach;
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

/// Results of validating the input.
struct Checked {
    key: ContentKey,
    points: u32,
    frame_count: u32,
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
        let (new, request, rest) = blocking(move || {
            let (request, rest) = (request_of(&new), blake3::hash(&new.rest));
            (new, request, rest)
        })
        .await?;
        let (frames, options) = (new.frames.digest(), new.options.clone());
        let may_be = |job: &CageJob| {
            let meta = &job.meta;
            let digests = [&meta.rest, &meta.frames].map(|part| part.blake3.as_str());
            meta.options == options && digests == [rest.to_hex().as_str(), frames.to_hex().as_str()]
        };
        let (config, name) = (self.config.clone(), tenant.name.clone());
        let check = move || {
            let checked = check(&new, &name, config.max_design_seconds, config.max_design_bytes);
            checked.map(|checked| (new, checked))
        };
        let make = async |service: Arc<Self>, tenant: Arc<Tenant>, (new, checked), request| {
            service.create_new_cage_job(&tenant, new, checked, request).await
        };
        self.create_job(tenant, request, may_be, check, make).await
    }

    async fn create_new_cage_job(
        self: &Arc<Self>,
        tenant: &Tenant,
        new: NewCageJob,
        checked: Checked,
        idempotency: Option<Idempotency>,
    ) -> Result<Arc<CageJob>, ApiError> {
        let NewCageJob { rest_name, rest, frames_name, frames, options, room: _room, mut reserved, .. } = new;
        let part = |name: String, bytes: u64, digest: blake3::Hash| StoredPart {
            name,
            bytes,
            blake3: digest.to_hex().to_string(),
        };
        let (id, created_ms) = new_job();
        let meta = CageJobMeta {
            id,
            tenant: tenant.name.clone(),
            created_ms,
            key: checked.key,
            options,
            points: checked.points,
            frame_count: checked.frame_count,
            rest: part(rest_name, rest.len() as u64, blake3::hash(&rest)),
            frames: part(frames_name, frames.bytes(), frames.digest()),
            idempotency,
        };
        if let Some(duplicate) = self.cage_jobs.duplicate(&tenant.name, &meta.key, None)
            && let Some(job) = self.create_finished(&meta, &duplicate).await
        {
            return Ok(job);
        }
        let place = self.job_place(&tenant.name)?;
        self.reserve_more(tenant, &mut reserved, meta.rest.bytes)?;
        let bytes = meta.rest.bytes + meta.frames.bytes;
        let (store, kept) = (self.store.clone(), meta.clone());
        blocking(move || store.create_cage_job(&kept, &rest, frames)).await??;
        let job = self.begin_job(place, meta, bytes);
        drop(reserved);
        Ok(job)
    }

    /// Creates a job with the outcome of a completed one of the same input; `None` if that cannot be read.
    async fn create_finished(self: &Arc<Self>, meta: &CageJobMeta, duplicate: &Arc<CageJob>) -> Option<Arc<CageJob>> {
        let Phase::Completed(found) = duplicate.phase() else { return None };
        let (store, duplicate, kept, finished) =
            (self.store.clone(), Arc::clone(duplicate), meta.clone(), found.clone());
        let stored = blocking(move || {
            let cage = duplicate.completed_cage(&store).ok()?;
            store.create_finished_cage_job(&kept, &Outcome::Completed(finished), &cage).ok()
        });
        stored.await.ok()??;
        let job = Arc::new(CageJob::new(meta.clone(), Phase::Completed(found.clone()), found.cage_bytes));
        self.cage_jobs.insert(Arc::clone(&job));
        metrics::counter!("cager_designs_total", "result" => "known").increment(1);
        Some(job)
    }

    /// Stores the outcome of a job and its cage, if any.
    pub(super) async fn finish_cage_job(&self, job: &Arc<CageJob>, outcome: Outcome<Finished>, cage: Option<Vec<u8>>) {
        let id = job.meta.id.clone();
        let write = move |store: &Store, outcome: &_| store.finish_cage_job(&id, outcome, cage.as_deref());
        self.finish_job(job, outcome, write).await;
    }

    /// Copies the outcome of a job of the same input; false if it cannot be read.
    pub(super) async fn copy_outcome(
        &self,
        job: &Arc<CageJob>,
        duplicate: &Arc<CageJob>,
        found: Box<Finished>,
    ) -> bool {
        let (store, duplicate) = (self.store.clone(), Arc::clone(duplicate));
        let Ok(Ok(cage)) = blocking(move || duplicate.completed_cage(&store)).await else { return false };
        self.finish_cage_job(job, Outcome::Completed(found), Some(cage.to_vec())).await;
        true
    }
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
fn check(new: &NewCageJob, tenant: &str, max_seconds: u64, max_bytes: u64) -> Result<Checked, ApiError> {
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
        tenant.as_bytes(),
        extension(&new.rest_name).as_bytes(),
        blake3::hash(&new.rest).as_bytes().as_slice(),
        extension(&new.frames_name).as_bytes(),
        frames.digest().as_bytes(),
    ]);
    Ok(Checked { key, points: points as u32, frame_count })
}
