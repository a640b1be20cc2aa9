//! Sessions, independent of HTTP: a rest pose with its cage that is being prepared, ready for frames, completed or failed.

mod announce;
pub(crate) mod cage_source;
pub(crate) mod commit;
pub(crate) mod complete;
mod container;
pub(crate) mod container_frames;
pub(crate) mod create;
pub(crate) mod facts;
pub(crate) mod frames;
mod group_coding;
pub(crate) mod groups;
mod idle;
mod last_groups;
pub(crate) mod registry;
mod rename;
mod resume;
pub(crate) mod retention;
pub(crate) mod solve;
mod source;
pub(crate) mod upload;
mod view;

use crate::engine::Lane;
use crate::preparation::ValidOptions;
use crate::problem::{self, ApiError};
use crate::service::Service;
use crate::store::{Completion, FrameEntry, Kind, SessionMeta, Store, StoreError};
use crate::sync::lock;
use crate::webhooks::Webhooks;
use cager_capture::coding::{Goal, GroupCoder, GroupDecoder};
use cager_core::regularize::Regularizer;
use cager_proto::messages::Problem;
use commit::{CommitQueue, Committer};
use facts::Facts;
use frames::Frames;
use groups::Groups;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering, fence};
use std::sync::{Arc, Mutex, MutexGuard, Weak};
use std::time::Instant;
use tokio::sync::watch;
use tokio_util::sync::CancellationToken;
use upload::FrameJob;

/// A session in memory.
pub(crate) struct Session {
    pub(crate) meta: SessionMeta,
    /// What it is called.
    name: Mutex<Option<String>>,
    /// Taken while it is given another name.
    renaming: Mutex<()>,
    store: Store,
    committer: Committer,
    webhooks: Arc<Webhooks>,
    status: Mutex<Status>,
    frames: Mutex<Frames>,
    /// Whether the stored frames have been added to `frames`.
    loaded: AtomicBool,
    /// When somebody asked for its frames.
    last_used: Mutex<Instant>,
    /// Taken while frames are stored or loaded; whether they have to be loaded again, after a write of which it is not known how it ended.
    appending: Mutex<bool>,
    queued: Arc<AtomicU64>,
    /// Bytes of its files and content on disk, and of frames queued for writing.
    pub(crate) bytes: AtomicU64,
    /// Bytes of its container that these include.
    container: AtomicU64,
    waiting: Mutex<CommitQueue>,
    /// The last solved frame and its cage, in sessions whose frames depend on their predecessors.
    last_solved: Mutex<Option<(u32, Vec<f32>)>>,
    lane: Mutex<Weak<SessionQueue>>,
    /// What the container is to meet; without it frames are stored as they are solved for.
    goal: Option<Goal>,
    groups: Mutex<Groups>,
    /// Codes the next group; taken while one is coded. `None` until it is needed.
    coding: Arc<tokio::sync::Mutex<Option<GroupCoder>>>,
    group_decoder: Mutex<Weak<GroupDecoder>>,
    /// Taken while the container is written, so that it is written once.
    pub(crate) completing: tokio::sync::Mutex<()>,
    version: watch::Sender<u64>,
    /// Whether writing the completion mark failed in a way that leaves its state on disk unknown; no frames are accepted meanwhile.
    completion_unknown: AtomicBool,
    /// The container is not as it was written.
    container_damaged: AtomicBool,
    /// Deletion has begun, so missing files are not damage.
    deleting: AtomicBool,
    deleted: CancellationToken,
}

/// State of a session, with the results of its preparation.
#[derive(Clone, Debug)]
pub(crate) struct Status {
    pub(crate) phase: Phase,
    pub(crate) facts: Option<Facts>,
}

/// State of a session.
#[derive(Clone, Debug)]
pub(crate) enum Phase {
    Preparing,
    Ready,
    Completed(Completion),
    Failed(Box<Problem>),
}

/// A session's queue in the engine, together with the prepared solver. It exists while uploads run, so that the solvers of idle sessions
/// can be evicted.
pub(crate) struct SessionQueue {
    pub(crate) lane: Lane<FrameJob>,
    uploads: AtomicU64,
}

impl SessionQueue {
    pub(crate) fn new(lane: Lane<FrameJob>) -> Self {
        Self { lane, uploads: AtomicU64::new(0) }
    }

    /// Counts an upload whose body is still arriving.
    pub(crate) fn upload_begins(&self) {
        if self.uploads.fetch_add(1, Ordering::Relaxed) == 0 {
            self.lane.expect_more(true);
        }
    }

    pub(crate) fn upload_ends(&self) {
        if self.uploads.fetch_sub(1, Ordering::Relaxed) == 1 {
            self.lane.expect_more(false);
        }
    }
}

impl Session {
    pub(crate) fn new(meta: SessionMeta, service: &Service, status: Status, is_new: bool) -> Self {
        let mut frames = Frames::default();
        if matches!(status.phase, Phase::Completed(_)) {
            frames.seal();
        }
        let goal = ValidOptions::of(&meta.options).ok().and_then(|valid| valid.goal);
        Self {
            name: Mutex::new(rename::name_of(&meta)),
            renaming: Mutex::default(),
            meta,
            store: service.store.clone(),
            committer: service.committer.clone(),
            webhooks: Arc::clone(&service.webhooks),
            status: Mutex::new(status),
            frames: Mutex::new(frames),
            loaded: AtomicBool::new(is_new),
            last_used: Mutex::new(Instant::now()),
            appending: Mutex::new(false),
            queued: Arc::default(),
            bytes: AtomicU64::new(0),
            container: AtomicU64::new(0),
            waiting: Mutex::default(),
            last_solved: Mutex::default(),
            lane: Mutex::default(),
            goal,
            groups: Mutex::default(),
            coding: Arc::default(),
            group_decoder: Mutex::default(),
            completing: tokio::sync::Mutex::new(()),
            version: watch::Sender::new(0),
            completion_unknown: AtomicBool::new(false),
            container_damaged: AtomicBool::new(false),
            deleting: AtomicBool::new(false),
            deleted: CancellationToken::new(),
        }
    }

    pub(crate) fn status(&self) -> Status {
        lock(&self.status).clone()
    }

    pub(crate) fn facts(&self) -> Option<Facts> {
        lock(&self.status).facts.clone()
    }

    pub(crate) fn set_status(&self, status: Status) {
        if matches!(status.phase, Phase::Completed(_)) {
            self.frames().seal();
        }
        *lock(&self.status) = status;
        self.touch();
    }

    pub(crate) fn has_failed(&self) -> bool {
        matches!(lock(&self.status).phase, Phase::Failed(_))
    }

    pub(crate) fn set_phase(&self, phase: Phase) {
        lock(&self.status).phase = phase;
        self.touch();
    }

    pub(crate) fn frames(&self) -> MutexGuard<'_, Frames> {
        lock(&self.frames)
    }

    /// Notifies all followers of a change.
    pub(crate) fn touch(&self) {
        self.version.send_modify(|version| *version += 1);
    }

    /// A counter that changes with every change of the session.
    pub(crate) fn changes(&self) -> watch::Receiver<u64> {
        self.version.subscribe()
    }

    /// Cancelled when the session is deleted.
    pub(crate) fn deleted(&self) -> &CancellationToken {
        &self.deleted
    }

    pub(crate) fn is_deleted(&self) -> bool {
        self.deleted.is_cancelled()
    }

    /// Sets whether its files are being deleted, so that their absence is not taken for damage.
    pub(crate) fn set_deleting(&self, deleting: bool) {
        self.deleting.store(deleting, Ordering::SeqCst);
    }

    /// Whether it is deleted, or being deleted.
    pub(crate) fn is_going(&self) -> bool {
        self.deleting.load(Ordering::SeqCst) || self.is_deleted()
    }

    /// The response for a storage error. Not by `?`, which would not know that the session is being deleted.
    pub(crate) fn storage_error(&self, error: StoreError) -> ApiError {
        if self.is_going() { gone() } else { error.into() }
    }

    /// Reads the stored frames, once. Blocks.
    ///
    /// # Errors
    /// Damaged frames, after which the session has failed; I/O errors.
    pub(crate) fn load(&self) -> Result<(), ApiError> {
        self.used();
        fence(Ordering::SeqCst);
        if self.loaded.load(Ordering::Acquire) {
            return Ok(());
        }
        match self.status() {
            // Frames are loaded before the session becomes ready.
            Status { facts: None, .. } => return Ok(()),
            // Only its failure is known.
            Status { phase: Phase::Failed(_), .. } => return Ok(()),
            _ => {}
        }
        let appending = lock(&self.appending);
        let loaded = if self.loaded.load(Ordering::Acquire) { Ok(()) } else { self.load_frames() };
        drop(appending);
        loaded.map_err(|error| self.fail_if_damaged(error))
    }

    /// As [`Self::load`], on the blocking pool.
    pub(crate) async fn ensure_loaded(self: &Arc<Self>) -> Result<(), ApiError> {
        self.used();
        fence(Ordering::SeqCst);
        if self.loaded.load(Ordering::Acquire) {
            return Ok(());
        }
        let session = Arc::clone(self);
        tokio::task::spawn_blocking(move || session.load()).await.map_err(|e| ApiError::internal(&e))?
    }

    /// Adds the stored frames to `frames`. The caller holds `appending`.
    fn load_frames(&self) -> Result<(), StoreError> {
        let mut entries = self.store.frames(&self.meta.id)?;
        if let Some(frames) = self.declared() {
            // Frames beyond the declared number were discarded at completion.
            entries.retain(|entry| entry.frame < frames);
            if entries.len() < frames as usize {
                return Err(self.damaged(format!("{} of {frames} frames are there", entries.len())));
            }
        }
        let rows = self.facts().map_or(0, |facts| facts.unknowns);
        if let Some(entry) = entries.iter().find(|entry| entry.cage_bytes() != 12 * rows) {
            return Err(self.damaged(format!("the cage of frame {} has not {rows} rows", entry.frame)));
        }
        // Where they were loaded before, new ones are frames that were stored although that reported an error.
        let mut frames = self.frames();
        let new: Vec<FrameEntry> = entries.into_iter().filter(|e| frames.adds_information(e)).collect();
        if self.loaded.load(Ordering::Acquire) {
            // The write that failed has taken them off the count.
            self.bytes.fetch_add(new.len() as u64 * self.stored_frame_bytes(), Ordering::Relaxed);
        }
        for entry in new {
            let same = frames.matches_pending(&entry);
            for upload in frames.solved(entry) {
                if same { upload.answer(entry.frame) } else { upload.fail(solve::conflict(entry.frame)) }
            }
        }
        drop(frames);
        if !self.loaded.load(Ordering::Acquire) {
            self.load_groups()?;
        }
        self.loaded.store(true, Ordering::Release);
        Ok(())
    }

    /// Damage of its frames.
    fn damaged(&self, what: impl Into<String>) -> StoreError {
        self.store.damaged_session(&self.meta.id, what.into())
    }

    /// Marks the session as failed, also in the store. The caller holds none of its locks.
    fn mark_damaged(&self, what: &str) -> ApiError {
        let error = frames_are_damaged();
        {
            let mut status = lock(&self.status);
            if matches!(status.phase, Phase::Failed(_)) {
                // Another thread has handled the damage.
                return error;
            }
            status.phase = Phase::Failed(error.problem.clone());
        }
        self.touch();
        // From here on nothing is stored, so nothing is acknowledged.
        drop(lock(&self.appending));
        tracing::error!(session = %self.meta.id, what, "stored frames are damaged; the session takes no more");
        metrics::counter!("cager_quarantined_total").increment(1);
        if let Err(error) = self.store.mark_damaged(Kind::Session, &self.meta.id, what) {
            tracing::error!(session = %self.meta.id, %error, "the damage could not be noted");
        }
        self.announce_unrecorded_failure();
        error
    }

    /// Appends the cages of these frames to `out`, m × 12 bytes each. Blocks.
    ///
    /// # Errors
    /// Damaged frames, after which the session has failed; I/O errors.
    pub(crate) fn read_cages(&self, entries: &[FrameEntry], out: &mut Vec<u8>) -> Result<(), ApiError> {
        self.store.cages(&self.meta.id, entries, out).map_err(|error| self.fail_if_damaged(error))
    }

    /// Reads all that is stored of its frames and its container, so that damage is found before a client needs them. Blocks.
    pub(crate) fn check_stored(&self) {
        if self.has_failed() || self.facts().is_none() {
            return;
        }
        match self.store.check_frames(&self.meta.id) {
            Ok(()) => self.check_container(),
            // It is logged.
            Err(error) => drop(self.fail_if_damaged(error)),
        }
    }

    /// The response for a storage error; damage fails the session.
    pub(crate) fn fail_if_damaged(&self, error: StoreError) -> ApiError {
        match error {
            // During deletion, missing files are not damage.
            StoreError::Damaged { what, .. } if !self.is_going() => self.mark_damaged(&what),
            error => self.storage_error(error),
        }
    }

    /// Whether every frame depends on the previous one, so that frames must arrive in order.
    pub(crate) fn follows_previous(&self) -> bool {
        self.meta.options.regularizer.as_deref() == Some(Regularizer::Temporal.name())
    }

    /// The lane shared by running uploads, created if there is none.
    pub(crate) fn queue(&self, make: impl FnOnce() -> SessionQueue) -> Arc<SessionQueue> {
        let mut lane = lock(&self.lane);
        lane.upgrade().unwrap_or_else(|| {
            let live = Arc::new(make());
            *lane = Arc::downgrade(&live);
            live
        })
    }

    /// Retries to determine the completion state where that failed before. Blocks.
    pub(crate) fn retry_failed_writes(&self) {
        if let Ok(_one) = self.completing.try_lock()
            && let Err(error) = self.resolve_completion()
        {
            tracing::warn!(session = %self.meta.id, detail = %error.problem.detail, "whether the session is complete cannot be determined yet");
        }
    }

    /// Stops all work for the session.
    pub(crate) fn mark_deleted(&self) {
        self.deleted.cancel();
        self.touch();
    }

    /// The number of frames declared at completion.
    pub(crate) fn declared(&self) -> Option<u32> {
        match &lock(&self.status).phase {
            Phase::Completed(completion) => Some(completion.frames),
            _ => None,
        }
    }

    /// Replaces `SESSION_DELETED` by the error for missing content if the session itself still exists.
    pub(crate) fn explain_missing_content(&self, error: ApiError) -> ApiError {
        if error.problem.word() != problem::SESSION_DELETED.word || self.is_deleted() {
            return error;
        }
        let detail = "the rest pose and cage of this session are missing on the service's disk; upload the same files as a new session, or have the operator restore them from a backup";
        ApiError::new(problem::SESSION_FAILED, detail)
    }
}

/// The failure of a session whose stored frames are damaged.
fn frames_are_damaged() -> ApiError {
    let detail = "stored frames of this session are damaged, and it takes no more; upload the capture to a new session";
    ApiError::new(problem::SESSION_FAILED, detail)
}

/// The error that ends requests to a deleted session.
pub(crate) fn gone() -> ApiError {
    ApiError::new(problem::SESSION_DELETED, "the session was deleted")
}
