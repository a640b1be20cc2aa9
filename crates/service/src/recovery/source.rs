//! Frames of a recovery as its surfaces: those that are stored, and then those that come.

use super::RecoveryJob;
use crate::admission::Permit;
use crate::problem::ApiError;
use crate::service::Service;
use crate::store::{StoreError, StoredPart};
use crate::sync::lock;
use cager_formats::{MeshFormat, frame_numbers, read_model_bytes};
use cager_geometry::mesh::Model;
use cager_motion::recover::{Arrival, RecoverError, SurfaceSource};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU32, Ordering::SeqCst};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};
use tokio::runtime::Handle;
use tokio::time::sleep_until;

/// How long a recovery waits for its next frame before it gives its memory back; the next frame then has it begin anew.
const FRAME_WAIT: Duration = Duration::from_secs(60);
/// How long it works while others wait for their turn.
const TURN: Duration = Duration::from_secs(5);

/// The stored frames of a recovery.
pub(super) struct StoredSurfaces {
    service: Arc<Service>,
    job: Arc<RecoveryJob>,
    runtime: Handle,
    /// The place among those that work, and since when; given back while there is nothing to do.
    place: Mutex<Option<(Permit, Instant)>>,
    /// How many frames were ever followed, over restarts.
    reached: AtomicU32,
    /// Why a stored frame could not be read.
    pub(super) failure: Mutex<Option<ApiError>>,
}

impl StoredSurfaces {
    /// With a place for the work. Call within a tokio runtime.
    pub(super) fn new(service: Arc<Service>, job: Arc<RecoveryJob>, place: Permit) -> Self {
        let (place, failure) = (Mutex::new(Some((place, Instant::now()))), Mutex::default());
        Self { service, job, runtime: Handle::current(), place, reached: AtomicU32::new(0), failure }
    }

    /// Notes that work begins, durably. Whether it may: not where it ended the process several times without getting any further. Blocks.
    ///
    /// # Errors
    /// Storage errors.
    pub(super) fn begin(&self) -> Result<bool, StoreError> {
        self.reached.store(self.service.store.reached_recovery(self.job.id())?, SeqCst);
        self.service.begin_attempt(&self.job)
    }

    /// Notes how many frames are followed: more than ever before are progress, after which attempts count from 0. Blocks.
    pub(super) fn followed(&self, frames: u32) {
        if self.reached.fetch_max(frames, SeqCst) < frames {
            match self.service.store.note_reached_recovery(self.job.id(), frames) {
                Ok(()) => self.job.forget_attempts(),
                Err(error) => tracing::debug!(job = self.job.id(), %error, "the count of its beginnings stays"),
            }
        }
    }

    /// Whether all that has come is followed and more may come.
    fn is_idle(&self) -> bool {
        let status = self.job.status();
        let progress = &status.progress;
        progress.declared.is_none() && progress.followed.len() >= progress.arrived as usize
    }

    /// Notes that the work is not what would end the process now. Blocks.
    pub(super) fn pause(&self) {
        let is_idle = self.is_idle();
        self.service.end_attempt(&self.job, |before| if is_idle { 0 } else { before.saturating_sub(1) });
    }

    /// Whether the work is to stop.
    pub(super) fn is_stopped(&self) -> bool {
        self.job.is_going() || self.service.stopping().is_cancelled()
    }

    fn part(&self, frame: usize) -> Option<StoredPart> {
        self.job.status().progress.frames.get(&u32::try_from(frame).ok()?).cloned()
    }

    /// Room to keep what is known while it waits.
    fn keep(&self) -> Option<Permit> {
        self.service.recoveries_kept.try_take(&self.job.meta.tenant, 1).ok()
    }

    /// Waits for a place to work at, with what it keeps meanwhile; after a while it is the turn of others who wait, where there is room to wait too.
    async fn take_place(&self, kept: Option<Permit>) -> Arrival {
        let since = lock(&self.place).as_ref().map(|(_, since)| *since);
        if since.is_some_and(|since| since.elapsed() < TURN) {
            return Arrival::There;
        }
        let Some(_kept) = kept.or_else(|| self.keep()) else { return Arrival::There };
        drop(lock(&self.place).take());
        tokio::select! {
            place = self.service.recovering.take(&self.job.meta.tenant, 1) => {
                *lock(&self.place) = Some((place, Instant::now()));
            }
            () = self.job.deleted().cancelled() => return Arrival::Stopped,
            () = self.service.stopping().cancelled() => return Arrival::Stopped,
        }
        Arrival::There
    }
}

impl SurfaceSource for StoredSurfaces {
    fn wait_for(&self, frame: usize) -> Arrival {
        self.runtime.block_on(async {
            let mut changes = self.job.changes();
            let mut kept: Option<(Permit, tokio::time::Instant)> = None;
            loop {
                changes.mark_unchanged();
                if self.is_stopped() {
                    return Arrival::Stopped;
                }
                let (arrived, declared) = {
                    let status = self.job.status();
                    (status.progress.arrived as usize, status.progress.declared)
                };
                if declared.is_some_and(|declared| frame >= declared as usize) {
                    return match self.take_place(kept.map(|(kept, _)| kept)).await {
                        Arrival::There => Arrival::End,
                        other => other,
                    };
                }
                if frame < arrived {
                    return self.take_place(kept.map(|(kept, _)| kept)).await;
                }
                let until = match &kept {
                    Some((_, until)) => *until,
                    None => {
                        // Where too many wait already, it gives its memory back at once; what it works on is finished in its place.
                        let Some(room) = self.keep() else { return Arrival::Stopped };
                        drop(lock(&self.place).take());
                        let until = tokio::time::Instant::now() + FRAME_WAIT;
                        kept = Some((room, until));
                        until
                    }
                };
                // The frames before may still be worked on for a moment.
                if self.is_idle() {
                    self.pause();
                }
                tokio::select! {
                    _ = changes.changed() => {}
                    () = self.job.deleted().cancelled() => return Arrival::Stopped,
                    () = self.service.stopping().cancelled() => return Arrival::Stopped,
                    () = sleep_until(until) => return Arrival::Stopped,
                }
            }
        })
    }

    fn read(&self, frame: usize) -> Result<Model, RecoverError> {
        if self.is_stopped() {
            return Err(RecoverError::Stopped);
        }
        let number = frame as u32;
        let missing = || RecoverError::Stored(format!("frame {frame} is not stored"));
        let part = self.part(frame).ok_or_else(missing)?;
        let bytes = self.service.store.recovery_frame(self.job.id(), number, &part).map_err(|error| {
            let stored = RecoverError::Stored(error.to_string());
            *lock(&self.failure) = Some(self.job.fail_if_damaged(&self.service.store, error));
            stored
        })?;
        let name = Path::new(&part.name);
        Ok(read_model_bytes(MeshFormat::from_path(name)?, name, &bytes)?)
    }

    fn file(&self, frame: usize) -> PathBuf {
        self.part(frame).map_or_else(PathBuf::new, |part| part.name.into())
    }

    fn numbers(&self, frames: usize) -> Option<Vec<f64>> {
        if let Some(start) = self.job.meta.options.start {
            return Some((0..frames).map(|frame| start + frame as f64).collect());
        }
        let files: Vec<PathBuf> = (0..frames).map(|frame| self.file(frame)).collect();
        frame_numbers(&files)
    }
}
