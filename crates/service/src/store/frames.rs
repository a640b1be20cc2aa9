//! The frames of sessions.

use super::names::check_id;
use super::{Kind, Store, StoreError};
use cager_store::{CatalogError, FrameEntry, NewFrame};
use std::time::Instant;

/// Frames whose cages are read at a time to check them.
const CHECKED_FRAMES: usize = 64;

impl Store {
    /// Stores solved frames of a session; durable on `Ok`. After an error none of them is there, unless the answer was lost. Gives their entries.
    ///
    /// # Errors
    /// Not found where the session was deleted.
    pub fn append_frames(&self, id: &str, frames: &[NewFrame<'_>]) -> Result<Vec<FrameEntry>, StoreError> {
        check_id(id)?;
        let clock = Instant::now();
        let stored = self.catalog().append(id, frames).map_err(|e| self.of_session(id, "write", e))?;
        metrics::histogram!("cager_fsync_seconds").record(clock.elapsed().as_secs_f64());
        let bytes: usize = frames.iter().map(|frame| 4 * frame.cage.len()).sum();
        metrics::counter!("cager_log_bytes_total").increment(bytes as u64);
        Ok(stored)
    }

    /// The frames of a session, ascending.
    ///
    /// # Errors
    /// [`StoreError::Damaged`].
    pub fn frames(&self, id: &str) -> Result<Vec<FrameEntry>, StoreError> {
        check_id(id)?;
        self.catalog().frames(id).map_err(|e| self.of_session(id, "read", e))
    }

    /// Bytes that the frames of a session take, about.
    pub fn frame_bytes(&self, id: &str) -> Result<u64, StoreError> {
        Ok(self.record(Kind::Session, id)?.map_or(0, |record| record.frame_bytes))
    }

    /// Appends the cages of frames to `out`, each m × 3 `f32`, little-endian. On an error `out` is unchanged.
    ///
    /// # Errors
    /// [`StoreError::Damaged`].
    pub fn cages(&self, id: &str, frames: &[FrameEntry], out: &mut Vec<u8>) -> Result<(), StoreError> {
        check_id(id)?;
        self.catalog().cages(id, frames, out).map_err(|e| self.of_session(id, "read", e))
    }

    /// Reads all frames of a session, to find damage before they are needed.
    ///
    /// # Errors
    /// [`StoreError::Damaged`].
    pub fn check_frames(&self, id: &str) -> Result<(), StoreError> {
        let mut cages = Vec::new();
        self.frames(id)?.chunks(CHECKED_FRAMES).try_for_each(|some| {
            cages.clear();
            self.cages(id, some, &mut cages)
        })
    }

    /// Damage of a session's frames.
    pub(crate) fn damaged_session(&self, id: &str, what: impl std::fmt::Display) -> StoreError {
        StoreError::damaged(self.catalog_path(), format!("{} {id}: {what}", Kind::Session.name()))
    }

    fn of_session(&self, id: &str, action: &'static str, error: CatalogError) -> StoreError {
        match error {
            CatalogError::Damaged(what) => self.damaged_session(id, what),
            error => self.failed(action, error),
        }
    }
}
