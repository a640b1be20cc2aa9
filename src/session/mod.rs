//! Sessions, independent of HTTP: a rest pose with its cage that is being prepared, ready for frames, completed or failed.

pub(crate) mod cage_source;
pub(crate) mod commit;
pub(crate) mod complete;
pub(crate) mod container_frames;
pub(crate) mod create;
pub(crate) mod facts;
pub(crate) mod frames;
pub(crate) mod groups;
mod last_groups;
pub(crate) mod registry;
mod resume;
pub(crate) mod retention;
pub(crate) mod solve;
mod source;
pub(crate) mod upload;
mod view;

use crate::coding::{Goal, GroupCoder, GroupDecoder};
use crate::engine::Lane;
use crate::preparation::Choices;
use crate::problem::{self, ApiError};
use crate::service::Service;
use crate::store::{Completion, FrameLog, Kind, LogEntry, LogReader, SessionMeta, Store, StoreError};
use crate::sync::lock;
use crate::webhooks::Webhooks;
use cager_core::regularize::Regularizer;
use cager_proto::messages::Problem;
use commit::{CommitQueue, Committer};
use facts::Facts;
use frames::Frames;
use groups::Groups;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, Weak};
use tokio::sync::watch;
use tokio_util::sync::CancellationToken;
use upload::FrameJob;

/// A session in memory.
pub(crate) struct Session {
    pub(crate) meta: SessionMeta,
    store: Store,
    committer: Committer,
    webhooks: Arc<Webhooks>,
    status: Mutex<Status>,
    frames: Mutex<Frames>,
    /// Whether the log exists on disk. It is created before the outcome of the preparation is stored, so that a log missing after a restart is
    /// recognised as damage.
    pub(crate) has_log: AtomicBool,
    /// Whether the frames in the log have been added to `frames`.
    loaded: AtomicBool,
    queued: Arc<AtomicU64>,
    /// Bytes of its files and content on disk, and of frames queued for writing.
    pub(crate) bytes: AtomicU64,
    /// Bytes of its container that these include.
    container: AtomicU64,
    waiting: Mutex<CommitQueue>,
    /// The last solved frame and its cage, in sessions whose frames depend on their predecessors.
    last_solved: Mutex<Option<(u32, Vec<f32>)>>,
    log: Mutex<Option<FrameLog>>,
    reader: Mutex<Option<LogReader>>,
    lane: Mutex<Weak<LiveLane>>,
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
pub(crate) struct LiveLane {
    pub(crate) lane: Lane<FrameJob>,
    uploads: AtomicU64,
}

impl LiveLane {
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
        let goal = Choices::of(&meta.options).ok().and_then(|choices| choices.goal);
        Self {
            meta,
            store: service.store.clone(),
            committer: service.committer.clone(),
            webhooks: Arc::clone(&service.webhooks),
            status: Mutex::new(status),
            frames: Mutex::new(frames),
            has_log: AtomicBool::new(false),
            loaded: AtomicBool::new(is_new),
            queued: Arc::default(),
            bytes: AtomicU64::new(0),
            container: AtomicU64::new(0),
            waiting: Mutex::default(),
            last_solved: Mutex::default(),
            log: Mutex::default(),
            reader: Mutex::default(),
            lane: Mutex::default(),
            goal,
            groups: Mutex::default(),
            coding: Arc::default(),
            group_decoder: Mutex::default(),
            completing: tokio::sync::Mutex::new(()),
            version: watch::Sender::new(0),
            completion_unknown: AtomicBool::new(false),
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

    /// The response for a storage error. Not by `?`, which would not know that the session is being deleted.
    pub(crate) fn storage_error(&self, error: StoreError) -> ApiError {
        if self.deleting.load(Ordering::SeqCst) || self.is_deleted() { gone() } else { error.into() }
    }

    /// Reads the frames in the log, once. Blocks.
    ///
    /// # Errors
    /// A damaged log, after which the session has failed and is in quarantine; I/O errors.
    pub(crate) fn load(&self) -> Result<(), ApiError> {
        if self.loaded.load(Ordering::Acquire) {
            return Ok(());
        }
        match self.status() {
            // The log is loaded before the session becomes ready.
            Status { facts: None, .. } => return Ok(()),
            // The session is in quarantine; only its failure is known.
            Status { phase: Phase::Failed(_), .. } => return Ok(()),
            _ => {}
        }
        let mut log = lock(&self.log);
        let opened = match self.loaded.load(Ordering::Acquire) {
            true => Ok(()),
            false => self.open_log(&mut log).map(|_| ()),
        };
        drop(log);
        opened.map_err(|error| self.fail_if_damaged(error))
    }

    /// Creates the log if it is missing. Blocks.
    pub(crate) fn make_log(&self) -> Result<(), StoreError> {
        let mut log = lock(&self.log);
        if self.is_deleted() { Ok(()) } else { self.open_log(&mut log).map(|_| ()) }
    }

    /// As [`Self::load`], on the blocking pool.
    pub(crate) async fn ensure_loaded(self: &Arc<Self>) -> Result<(), ApiError> {
        if self.loaded.load(Ordering::Acquire) {
            return Ok(());
        }
        let session = Arc::clone(self);
        tokio::task::spawn_blocking(move || session.load()).await.map_err(|e| ApiError::internal(&e))?
    }

    /// Opens the log and adds the frames found in it to `frames`. The caller holds the lock of `log`.
    fn load_log(&self) -> Result<FrameLog, StoreError> {
        let rows = self.facts().map_or(0, |facts| facts.unknowns);
        if self.has_log.load(Ordering::Acquire) && !self.store.has_log(&self.meta.id)? {
            return Err(self.damaged("the frame log is gone"));
        }
        let (log, mut entries) = self.store.open_log(&self.meta.id, rows)?;
        self.has_log.store(true, Ordering::Release);
        if let Some(frames) = self.declared() {
            // Frames beyond the declared number were discarded at completion.
            entries.retain(|entry| entry.frame < frames);
        }
        if let Some(frames) = self.declared()
            && entries.len() < frames as usize
        {
            return Err(self.damaged(format!("{} of {frames} frames are there", entries.len())));
        }
        *lock(&self.reader) = Some(log.reader());
        // In a log that was loaded before, new entries are frames that reached the disk although their append reported an error.
        let mut frames = self.frames();
        let new: Vec<LogEntry> = entries.into_iter().filter(|e| frames.adds_information(e)).collect();
        if self.loaded.load(Ordering::Acquire) {
            // The append that failed has taken them off the count.
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
        Ok(log)
    }

    /// Damage of its frames.
    fn damaged(&self, what: impl Into<String>) -> StoreError {
        StoreError::damaged(&self.store.log_path(&self.meta.id), what)
    }

    /// Marks the session as failed and moves its files to quarantine. The caller holds none of its locks.
    fn quarantine(&self, path: &std::path::Path, what: &str) -> ApiError {
        let error = ApiError::new(
            problem::SESSION_FAILED,
            "stored frames of this session are damaged, and its files were moved to quarantine; upload the capture to a new session",
        );
        {
            let mut status = lock(&self.status);
            if matches!(status.phase, Phase::Failed(_)) {
                // Another thread has handled the damage.
                return error;
            }
            status.phase = Phase::Failed(error.problem.clone());
        }
        self.touch();
        // From here on nothing is appended, so nothing is acknowledged.
        *lock(&self.log) = None;
        *lock(&self.reader) = None;
        tracing::error!(session = %self.meta.id, path = %path.display(), what, "the frame log is damaged; the session is moved to quarantine");
        metrics::counter!("cager_quarantined_total").increment(1);
        if let Err(error) = self.store.quarantine(Kind::Session, &self.meta.id, what) {
            tracing::error!(session = %self.meta.id, %error, "it could not be moved");
        }
        self.webhooks.send_unrecorded(self);
        error
    }

    /// Appends the cages of these frames to `out`, m × 12 bytes each. Blocks.
    ///
    /// # Errors
    /// A damaged log, after which the session has failed and is in quarantine; I/O errors.
    pub(crate) fn read_cages(&self, entries: &[LogEntry], out: &mut Vec<u8>) -> Result<(), ApiError> {
        self.reader().and_then(|reader| reader.read_cages(entries, out)).map_err(|error| self.fail_if_damaged(error))
    }

    /// A reader of the log, reopened without scanning if it was closed while idle.
    fn reader(&self) -> Result<LogReader, StoreError> {
        let mut kept = lock(&self.reader);
        if let Some(reader) = &*kept {
            return Ok(reader.clone());
        }
        let rows = self.facts().map_or(0, |facts| facts.unknowns);
        let reader = self.store.log_reader(&self.meta.id, rows)?;
        Ok(kept.insert(reader).clone())
    }

    /// The response for a storage error; damage fails the session and quarantines it.
    pub(crate) fn fail_if_damaged(&self, error: StoreError) -> ApiError {
        match error {
            // During deletion, missing files are not damage.
            StoreError::Damaged { path, what } if !self.deleting.load(Ordering::SeqCst) && !self.is_deleted() => {
                self.quarantine(&path, &what)
            }
            error => self.storage_error(error),
        }
    }

    /// Whether every frame depends on the previous one, so that frames must arrive in order.
    pub(crate) fn follows_previous(&self) -> bool {
        self.meta.options.regularizer.as_deref() == Some(Regularizer::Temporal.name())
    }

    /// The lane shared by running uploads, created if there is none.
    pub(crate) fn live_lane(&self, make: impl FnOnce() -> LiveLane) -> Arc<LiveLane> {
        let mut lane = lock(&self.lane);
        lane.upgrade().unwrap_or_else(|| {
            let live = Arc::new(make());
            *lane = Arc::downgrade(&live);
            live
        })
    }

    /// Retries what failed before: determining the completion state, and rewriting log blocks that a failed sync may have lost. Blocks.
    pub(crate) fn retry_failed_writes(&self) {
        if let Ok(_one) = self.completing.try_lock()
            && let Err(error) = self.resolve_completion()
        {
            tracing::warn!(session = %self.meta.id, detail = %error.problem.detail, "whether the session is complete cannot be determined yet");
        }
        if self.has_failed() || !self.store.log_needs_rewrite(&self.meta.id) {
            return;
        }
        if let Err(error) = self.open_log(&mut lock(&self.log)) {
            tracing::warn!(session = %self.meta.id, %error, "the frame log cannot be made safe yet");
        }
    }

    /// Closes files of a session that nobody uses.
    pub(crate) fn close_files_if_idle(&self) {
        let idle = lock(&self.lane).strong_count() == 0 && !lock(&self.waiting).busy;
        if idle && let Ok(mut log) = self.log.try_lock() {
            *lock(&self.reader) = None;
            *log = None;
            self.forget_coder();
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

/// The error that ends requests to a deleted session.
pub(crate) fn gone() -> ApiError {
    ApiError::new(problem::SESSION_DELETED, "the session was deleted")
}
