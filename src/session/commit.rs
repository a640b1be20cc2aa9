//! Writing solved frames: what waits for a session is written together and synced once, then its uploads hear of it.

use super::frames::Digests;
use super::{Phase, Session};
use crate::capture::StoredError;
use crate::problem::{self, ApiError};
use crate::store::{FrameLog, LogRecord, StoreError};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::Ordering::Relaxed;
use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Arc, Mutex, PoisonError};
use tokio::sync::OwnedSemaphorePermit;

/// What the log adds to a cage, about.
const RECORD_BYTES: usize = 96;

/// A solved frame that is not on disk yet.
pub(crate) struct Solved {
    pub(crate) frame: u32,
    pub(crate) digests: Digests,
    pub(crate) error: StoredError,
    pub(crate) cage: Vec<f32>,
    /// Its place among the upload's frames that are not on disk.
    pub(crate) _permit: Option<OwnedSemaphorePermit>,
}

/// What waits to be written, and whether a thread is at it.
#[derive(Default)]
pub(crate) struct Waiting {
    solved: Vec<Solved>,
    busy: bool,
}

impl Waiting {
    /// Whether something is being written or will be.
    pub(crate) fn is_busy(&self) -> bool {
        self.busy
    }
}

/// Threads that write and sync.
#[derive(Clone)]
pub(crate) struct Committer {
    sessions: Sender<Arc<Session>>,
}

impl Committer {
    /// Starts `threads` of them. They end when the last clone is dropped.
    pub(crate) fn start(threads: usize) -> std::io::Result<Self> {
        let (sessions, queue) = channel();
        let queue = Arc::new(Mutex::new(queue));
        for k in 0..threads {
            let queue = Arc::clone(&queue);
            std::thread::Builder::new().name(format!("commit-{k}")).spawn(move || run(&queue))?;
        }
        Ok(Self { sessions })
    }
}

/// What frames take in the log, about.
fn stored_bytes(solved: &[Solved]) -> u64 {
    solved.iter().map(|s| (RECORD_BYTES + 4 * s.cage.len()) as u64).sum()
}

fn run(queue: &Mutex<Receiver<Arc<Session>>>) {
    loop {
        let next = queue.lock().unwrap_or_else(PoisonError::into_inner).recv();
        let Ok(session) = next else { return };
        let solved = std::mem::take(&mut super::lock(&session.waiting).solved);
        if catch_unwind(AssertUnwindSafe(|| session.write(&solved))).is_err() {
            session.give_up(&solved, &ApiError::internal(&"writing frames panicked"));
        }
        let mut waiting = super::lock(&session.waiting);
        waiting.busy = !waiting.solved.is_empty();
        if waiting.busy {
            drop(waiting);
            session.enqueue();
        }
    }
}

impl Session {
    /// Takes over solved frames, to be written soon.
    pub(crate) fn commit(self: &Arc<Self>, solved: Vec<Solved>) {
        if solved.is_empty() {
            return;
        }
        // Counted before they are written, so that a quota holds however slow the disk is.
        self.bytes.fetch_add(stored_bytes(&solved), Relaxed);
        let mut waiting = super::lock(&self.waiting);
        waiting.solved.extend(solved);
        if !waiting.busy {
            waiting.busy = true;
            drop(waiting);
            self.enqueue();
        }
    }

    fn enqueue(self: &Arc<Self>) {
        // The threads live as long as any session.
        let _ = self.committer.sessions.send(Arc::clone(self));
    }

    /// Writes frames, syncs them and tells their uploads.
    fn write(&self, solved: &[Solved]) {
        let solved = self.written_after_their_predecessors(solved);
        if solved.is_empty() {
            return;
        }
        let mut records: Vec<LogRecord<'_>> = solved
            .iter()
            .map(|s| LogRecord {
                frame: s.frame,
                l2: s.error.l2,
                linf: s.error.linf,
                squared: s.error.squared,
                spread: s.error.spread,
                handle_digest: s.digests.handles,
                full_digest: s.digests.full,
                cage: &s.cage,
            })
            .collect();
        let mut log = super::lock(&self.log);
        if let Phase::Failed(problem) = self.status().phase {
            // Its files are in quarantine.
            drop(log);
            self.bytes.fetch_sub(stored_bytes(solved), Relaxed);
            self.give_up(solved, &ApiError::new(problem::SESSION_FAILED, problem.detail));
            return;
        }
        let outcome = self.open_log(&mut log).and_then(|log| {
            // Some were found in the log when it was opened; they are counted already.
            records.retain(|record| {
                let frames = self.frames();
                let known = frames.entry(record.frame);
                known.is_none_or(|known| known.full_digest.is_none() && record.full_digest.is_some())
            });
            log.append(&records)
        });
        if outcome.is_err() {
            // Whether it can go on is found out by opening it again.
            *log = None;
        }
        drop(log);
        match outcome {
            Ok(entries) => {
                let measured = entries.iter().filter(|entry| entry.full_digest.is_some()).count();
                metrics::counter!("cager_frames_total", "tenant" => self.meta.tenant.clone(), "rows" => "all")
                    .increment(measured as u64);
                metrics::counter!("cager_frames_total", "tenant" => self.meta.tenant.clone(), "rows" => "handles")
                    .increment((entries.len() - measured) as u64);
                for entry in entries {
                    let uploads = self.frames().solved(entry);
                    uploads.iter().for_each(|upload| upload.answer(entry.frame));
                }
            }
            Err(error) => {
                self.bytes.fetch_sub(stored_bytes(solved), Relaxed);
                tracing::warn!(session = %self.meta.id, %error, "frames could not be written");
                let error = self.damaged_or(error);
                self.give_up(solved, &error);
            }
        }
        self.touch();
    }

    /// Where frames depend on those before them, gives up the ones whose predecessor could not be written: what is on disk must
    /// come from what is on disk.
    fn written_after_their_predecessors<'a>(&self, solved: &'a [Solved]) -> &'a [Solved] {
        if !self.follows_previous() {
            return solved;
        }
        let there = |frame: u32, before: &[Solved]| {
            before.iter().any(|s| s.frame == frame) || self.frames().entry(frame).is_some()
        };
        let orphan = (0..solved.len()).find(|&k| solved[k].frame > 0 && !there(solved[k].frame - 1, &solved[..k]));
        let (written, orphans) = solved.split_at(orphan.unwrap_or(solved.len()));
        if let Some(first) = orphans.first() {
            self.bytes.fetch_sub(stored_bytes(orphans), Relaxed);
            self.give_up(orphans, &super::solve::predecessor_missing(first.frame));
        }
        written
    }

    /// Tells the uploads of frames that are not written why.
    fn give_up(&self, solved: &[Solved], error: &ApiError) {
        for s in solved {
            let uploads = self.frames().gave_up(s.frame);
            uploads.iter().for_each(|upload| upload.fail(error.clone().frame(s.frame)));
        }
    }

    /// The log, opened if it is not. What it holds that is not known yet becomes known.
    fn open_log<'a>(&self, log: &'a mut Option<FrameLog>) -> Result<&'a mut FrameLog, StoreError> {
        if log.is_none() {
            *log = Some(self.load_log()?);
        }
        Ok(log.as_mut().expect("it was just opened"))
    }
}

/// What a client hears when the store refuses.
pub(crate) fn storage_error(error: &StoreError) -> ApiError {
    match error {
        StoreError::Full { .. } => ApiError::new(
            problem::STORAGE_FULL,
            "the service's disk is full; nothing that was answered is lost, so try again when the operator has made room",
        )
        .retry_after(60),
        StoreError::Io { .. } => {
            tracing::error!(%error, "a file of the store cannot be read or written");
            let detail = "the service's disk failed to read or write what this needs; nothing that was answered is lost, so try again when the operator has looked at the disk";
            ApiError::new(problem::STORAGE_FAILED, detail).retry_after(10)
        }
        StoreError::Damaged { .. } => {
            tracing::error!(%error, "a file of the store is damaged");
            let detail = "what the service stored for this is damaged; upload it again to a new session, or have the operator restore it from a backup";
            ApiError::new(problem::SESSION_FAILED, detail)
        }
        other => ApiError::internal(other),
    }
}
