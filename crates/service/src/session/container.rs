//! The container of a completed session as it is found on disk. One that is not as it was written is damage, which the session says until it is completed again.

use super::resume::CompletionState;
use super::{Session, gone};
use crate::problem::{self, ApiError};
use crate::store::{Completion, StoreError};
use std::fs::File;
use std::sync::atomic::Ordering::{AcqRel, Acquire, Release};

impl Session {
    /// Opens the container for reading; what is looked at is its length. Blocks.
    ///
    /// # Errors
    /// A container that is missing or has another length; storage errors.
    pub(crate) fn open_container(&self, completion: &Completion) -> Result<File, ApiError> {
        let path = self.store.container_path(&self.meta.id);
        let file = match self.store.open_file(&path) {
            Err(error) if error.is_not_found() => return Err(self.container_is_damaged("it is missing")),
            opened => opened.map_err(|error| self.storage_error(error))?,
        };
        let there = file.metadata().map_err(|error| self.storage_error(StoreError::of(&path, "read", error)))?.len();
        let expected = completion.container_bytes;
        if there == expected {
            return Ok(file);
        }
        Err(self.container_is_damaged(&format!("it has {there} bytes, and was written with {expected}")))
    }

    /// Notes that the container is not as it was written: the session is to be completed again, which writes the same bytes.
    pub(super) fn container_is_damaged(&self, what: &str) -> ApiError {
        if self.is_going() {
            return gone();
        }
        if !self.container_damaged.swap(true, AcqRel) {
            tracing::error!(session = %self.meta.id, what, "the container is damaged; complete the session again");
            metrics::counter!("cager_quarantined_total").increment(1);
            let phase = CompletionState::Damaged.phase(&mut self.frames());
            self.set_phase(phase);
        }
        damaged()
    }

    /// Notes whether the container was found damaged, which was counted and is in the log.
    pub(super) fn set_container_damaged(&self, is_damaged: bool) {
        self.container_damaged.store(is_damaged, Release);
    }

    /// Why there is no container although the session was completed.
    pub(crate) fn container_problem(&self) -> Option<ApiError> {
        self.container_damaged.load(Acquire).then(damaged)
    }
}

fn damaged() -> ApiError {
    let detail = "the container of this session is damaged on the service's disk; complete the session again with its number of frames, which writes the same bytes again";
    ApiError::new(problem::STORAGE_FAILED, detail).retry_after(60)
}
