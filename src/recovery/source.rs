//! Frames of a recovery as its surfaces: those that are stored, and then those that come.

use super::RecoveryJob;
use crate::admission::Held;
use crate::problem::ApiError;
use crate::recover::{Arrival, RecoverError, SurfaceSource};
use crate::service::Service;
use crate::store::StoredPart;
use crate::sync::lock;
use cager_formats::{MeshFormat, frame_numbers, read_model_bytes};
use cager_geometry::mesh::Model;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};
use tokio::runtime::Handle;

/// How long a recovery waits for its next frame before it gives its memory back; the next frame then has it begin anew.
const PATIENCE: Duration = Duration::from_secs(60);
/// How long it works while others wait for their turn.
const TURN: Duration = Duration::from_secs(5);

/// The stored frames of a recovery.
pub(super) struct StoredSurfaces {
    service: Arc<Service>,
    job: Arc<RecoveryJob>,
    runtime: Handle,
    /// The place among those that work, and since when; given back while there is nothing to do.
    place: Mutex<Option<(Held, Instant)>>,
    /// Why a stored frame could not be read.
    pub(super) failure: Mutex<Option<ApiError>>,
}

impl StoredSurfaces {
    /// With a place for the work. Call within a tokio runtime.
    pub(super) fn new(service: Arc<Service>, job: Arc<RecoveryJob>, place: Held) -> Self {
        let (place, failure) = (Mutex::new(Some((place, Instant::now()))), Mutex::default());
        Self { service, job, runtime: Handle::current(), place, failure }
    }

    /// Whether the work is to stop.
    pub(super) fn is_stopped(&self) -> bool {
        self.job.is_going() || self.service.stopping().is_cancelled()
    }

    fn part(&self, frame: usize) -> Option<StoredPart> {
        self.job.status().progress.frames.get(&u32::try_from(frame).ok()?).cloned()
    }

    /// Waits for a place to work at; after a while it is the turn of others who wait.
    async fn take_place(&self) -> Arrival {
        if lock(&self.place).as_ref().is_some_and(|(_, since)| since.elapsed() < TURN) {
            return Arrival::There;
        }
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
                    return self.take_place().await.and_end();
                }
                if frame < arrived {
                    return self.take_place().await;
                }
                // The frames before may still be worked on for a moment.
                drop(lock(&self.place).take());
                tokio::select! {
                    _ = changes.changed() => {}
                    () = self.job.deleted().cancelled() => return Arrival::Stopped,
                    () = self.service.stopping().cancelled() => return Arrival::Stopped,
                    () = tokio::time::sleep(PATIENCE) => return Arrival::Stopped,
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

impl Arrival {
    /// The end in place of a frame.
    fn and_end(self) -> Self {
        if self == Self::There { Self::End } else { self }
    }
}
