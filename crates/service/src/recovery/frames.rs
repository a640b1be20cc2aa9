//! Frames of a recovery as they are sent, and the end of them.

use super::valid_options::{MAX_FRAMES, ValidOptions};
use super::view::missing;
use super::{RecoveryJob, closed};
use crate::admission::Permit;
use crate::auth::Tenant;
use crate::problem::{self, ApiError};
use crate::service::Service;
use crate::store::{NamedFile, StoredPart};
use crate::tasks::{blocking, to_the_end};
use cager_formats::{MeshFormat, read_model_bytes};
use cager_motion::recover::observed;
use cager_proto::recovery_messages::PostedFrame;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::Ordering::Relaxed;

/// Least bytes that a frame counts.
const LEAST_BYTES: u64 = 4096;

impl Service {
    /// Checks a frame and stores it, durably; the same frame again changes nothing. Runs to the end even if the client disconnects.
    ///
    /// # Errors
    /// A file that holds no surface, other bytes than before, a recovery that takes no frames, a quota that is used up, and storage errors.
    pub(crate) async fn post_recovery_frame(
        self: &Arc<Self>,
        tenant: &Arc<Tenant>,
        job: &Arc<RecoveryJob>,
        frame: u32,
        file: NamedFile,
        room: Permit,
    ) -> Result<PostedFrame, ApiError> {
        if let Some(error) = closed(job) {
            return Err(error);
        }
        expected(job, frame, &file.name)?;
        let (file, part) = blocking(move || {
            let part = StoredPart::of(&file.name, &file.bytes);
            (file, part)
        })
        .await?;
        let posted = PostedFrame { frame, file: part.name.clone(), bytes: part.bytes };
        if is_known(job, frame, &part)? {
            return Ok(posted);
        }
        let place = self.parse_slots.take(&tenant.name, 1).await;
        let checking = Arc::clone(job);
        let file = blocking(move || {
            let _place = place;
            check(&checking, frame, &file).map(|()| file)
        })
        .await??;
        let (service, tenant, job) = (Arc::clone(self), Arc::clone(tenant), Arc::clone(job));
        to_the_end(async move {
            let _room = room;
            let storing = Arc::clone(&job.status().progress.storing);
            let _one = storing.lock().await;
            // Another request may have been first.
            if is_known(&job, frame, &part)? {
                return Ok(posted);
            }
            if let Some(error) = closed(&job) {
                return Err(error);
            }
            // The end may have been declared while it was looked at.
            expected(&job, frame, &part.name)?;
            let counted = counted_bytes(&part);
            let _reserved = service.reserve_frames(&tenant, counted, 1)?;
            let (store, id, kept) = (service.store.clone(), job.meta.id.clone(), part.clone());
            let stored = blocking(move || store.put_recovery_frame(&id, frame, &kept, &file.bytes)).await?;
            stored.map_err(|error| job.fail_if_damaged(&service.store, error))?;
            job.bytes.fetch_add(counted, Relaxed);
            let counter = metrics::counter!("cager_received_bytes_total", "tenant" => tenant.name.clone());
            counter.increment(part.bytes);
            job.progressed(|progress| {
                progress.frames.insert(frame, part);
                progress.count();
            });
            Ok(posted)
        })
        .await
    }

    /// Notes durably how many frames there are; from then on none is taken that is not there. Runs to the end even if the client disconnects.
    ///
    /// # Errors
    /// Frames that are missing or beyond, another number than before, and storage errors.
    pub(crate) async fn complete_recovery(
        self: &Arc<Self>,
        job: &Arc<RecoveryJob>,
        frames: u32,
    ) -> Result<(), ApiError> {
        let (service, job) = (Arc::clone(self), Arc::clone(job));
        to_the_end(async move {
            let storing = Arc::clone(&job.status().progress.storing);
            let _one = storing.lock().await;
            if let Ok(finished) = job.finished()
                && finished.frames == frames
            {
                return Ok(());
            }
            if let Some(error) = closed(&job) {
                return Err(error);
            }
            if may_end(&job, frames)? {
                return Ok(());
            }
            let (store, id) = (service.store.clone(), job.meta.id.clone());
            let noted = blocking(move || store.declare_recovery(&id, frames)).await?;
            noted.map_err(|error| job.fail_if_damaged(&service.store, error))?;
            job.progressed(|progress| progress.declared = Some(frames));
            Ok(())
        })
        .await
    }
}

/// What a frame counts of a tenant's disk: a small one takes a block all the same, and memory.
pub(super) fn counted_bytes(part: &StoredPart) -> u64 {
    part.bytes.max(LEAST_BYTES)
}

/// Whether so many frames have been said already.
fn may_end(job: &RecoveryJob, frames: u32) -> Result<bool, ApiError> {
    let refuse = |kind, detail: String| Err(ApiError::new(kind, detail));
    if frames == 0 {
        return refuse(problem::INVALID_OPTIONS, "frames: an animation has at least one frame".to_owned());
    }
    let status = job.status();
    let progress = &status.progress;
    match progress.declared {
        Some(declared) if declared == frames => return Ok(true),
        Some(declared) => {
            let detail = format!("the recovery is being finished with {declared} frames, not {frames}");
            return refuse(problem::RECOVERY_COMPLETED, detail);
        }
        None => {}
    }
    if progress.arrived < frames {
        let detail = format!("{} of {frames} frames are there without a gap; post the missing ones", progress.arrived);
        return Err(ApiError::new(problem::FRAMES_MISSING, detail).missing(missing(progress, Some(frames))));
    }
    if let Some((&last, _)) = progress.frames.last_key_value().filter(|(last, _)| **last >= frames) {
        let detail =
            format!("frame {last} was posted, beyond the {frames} frames said; complete with all that were posted");
        return refuse(problem::FRAME_CONFLICT, detail);
    }
    Ok(false)
}

/// Refuses frames beyond those that there are.
fn expected(job: &RecoveryJob, frame: u32, name: &str) -> Result<(), ApiError> {
    if let Some(declared) = job.status().progress.declared.filter(|declared| frame >= *declared) {
        let detail = format!("frame {frame}: {name}: the recovery is being finished with {declared} frames");
        return Err(ApiError::new(problem::RECOVERY_COMPLETED, detail).frame(frame));
    }
    if frame >= MAX_FRAMES {
        let detail = format!(
            "frame {frame}: {name}: a recovery has at most {MAX_FRAMES} frames, which count from 0; make one for each part of the sequence"
        );
        return Err(ApiError::new(problem::INVALID_FRAME, detail).frame(frame).limit(u64::from(MAX_FRAMES)));
    }
    if let Some(frames) = job.meta.options.frames.filter(|frames| frame >= *frames) {
        let detail = format!(
            "frame {frame}: {name}: is beyond the {frames} frames that the recovery was made for, which count from 0; check its number"
        );
        return Err(ApiError::new(problem::INVALID_FRAME, detail).frame(frame));
    }
    Ok(())
}

/// Whether the frame is there.
fn is_known(job: &RecoveryJob, frame: u32, part: &StoredPart) -> Result<bool, ApiError> {
    match job.status().progress.frames.get(&frame) {
        None => Ok(false),
        Some(known) if known.blake3 == part.blake3 => Ok(true),
        Some(known) => {
            let detail = format!(
                "frame {frame}: {}: was posted before with other bytes, as {}; check its number",
                part.name, known.name
            );
            Err(ApiError::new(problem::FRAME_CONFLICT, detail).frame(frame))
        }
    }
}

/// Refuses a file that holds no surface. Blocks.
fn check(job: &RecoveryJob, frame: u32, file: &NamedFile) -> Result<(), ApiError> {
    let refuse = |what: String| ApiError::new(problem::INVALID_FRAME, format!("frame {frame}: {what}")).frame(frame);
    let options = &job.meta.options;
    let path = Path::new(&file.name);
    let format = MeshFormat::from_path(path).map_err(|error| refuse(error.to_string()))?;
    let mut model = read_model_bytes(format, path, &file.bytes).map_err(|error| refuse(error.to_string()))?;
    cager_capture::origin::move_to(job.meta.origin, &mut model.points);
    let points = ValidOptions::of(options, job.meta.parts.rig.is_some())?.recover.points;
    match observed(&model, frame as usize, points) {
        Err(error) if !options.force => Err(refuse(format!(
            "{}: {error}; or make the recovery with force (--force on the command line) to go on without such frames",
            file.name
        ))),
        _ => Ok(()),
    }
}
