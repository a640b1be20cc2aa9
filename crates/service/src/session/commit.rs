//! Group commit of solved frames: everything queued for a session is stored at once, then its uploads are notified.

use super::upload::Permits;
use super::{Phase, Session};
use crate::problem::{self, ApiError};
use crate::store::{FrameEntry, NewFrame, StoreError};
use crate::sync::lock;
use std::collections::{HashMap, VecDeque};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::Ordering::Relaxed;
use std::sync::{Arc, Mutex};

/// Threads that store the frames of one tenant; they mostly wait for the disk.
const THREADS: usize = 2;
/// Approximate size of a stored frame without its cage, in bytes.
const RECORD_BYTES: usize = 96;

/// Approximate bytes on disk of a frame with a cage of so many unknowns, of which so many bytes wait to be coded.
pub(crate) fn frame_bytes(unknowns: usize, posted: usize) -> u64 {
    (RECORD_BYTES + 12 * unknowns + posted) as u64
}

/// A solved frame that is not on disk yet.
pub(crate) struct SolvedFrame {
    /// What is stored of it beside its cage.
    pub(crate) entry: FrameEntry,
    pub(crate) cage: Vec<f32>,
    /// As it was posted, where it has to wait on disk until its group is coded.
    pub(crate) posted: Option<Vec<u8>>,
    /// What it counts against: the upload's limit of frames that are not on disk yet, and with `posted` its memory.
    pub(crate) _permits: Option<Permits>,
}

/// Frames queued for writing, and whether a commit thread is working on the session.
#[derive(Default)]
pub(crate) struct CommitQueue {
    solved: Vec<SolvedFrame>,
    pub(super) busy: bool,
}

/// Sessions whose frames are to be stored, by tenant: each tenant has threads of its own, which are there while it has
/// frames, so that the slow bucket
/// or the large frames of one never delay the answer to another.
#[derive(Clone, Default)]
pub(crate) struct Committer {
    tenants: Arc<Mutex<HashMap<String, Waiting>>>,
}

/// What a tenant has waiting.
#[derive(Default)]
struct Waiting {
    sessions: VecDeque<Arc<Session>>,
    threads: usize,
}

impl Committer {
    /// Stores the frames of a session when it is its turn.
    fn enqueue(&self, session: Arc<Session>) {
        let mut tenants = lock(&self.tenants);
        let tenant = session.meta.tenant.clone();
        let waiting = tenants.entry(tenant.clone()).or_default();
        waiting.sessions.push_back(session);
        if waiting.threads >= THREADS {
            return;
        }
        let committer = self.clone();
        let thread = std::thread::Builder::new().name("commit".to_owned()).spawn(move || committer.run(&tenant));
        match thread {
            Ok(_) => waiting.threads += 1,
            Err(error) if waiting.threads > 0 => {
                tracing::warn!(%error, "frames of a tenant are stored by fewer threads");
            }
            Err(error) => {
                let waiting: Vec<_> = waiting.sessions.drain(..).collect();
                drop(tenants);
                let error = ApiError::internal(&error);
                waiting.iter().for_each(|session| session.give_up_waiting(&error));
            }
        }
    }

    /// Stores what a tenant has waiting.
    fn run(&self, tenant: &str) {
        loop {
            let next = {
                let mut tenants = lock(&self.tenants);
                let Some(waiting) = tenants.get_mut(tenant) else { return };
                let next = waiting.sessions.pop_front();
                if next.is_none() {
                    waiting.threads -= 1;
                    if waiting.threads == 0 {
                        tenants.remove(tenant);
                    }
                }
                next
            };
            let Some(session) = next else { return };
            let solved = std::mem::take(&mut lock(&session.waiting).solved);
            if catch_unwind(AssertUnwindSafe(|| session.write(&solved))).is_err() {
                session.give_up(&solved, &ApiError::internal(&"writing frames panicked"));
            }
            let is_busy = {
                let mut waiting = lock(&session.waiting);
                waiting.busy = !waiting.solved.is_empty();
                waiting.busy
            };
            if is_busy {
                // Behind the tenant's others; this thread takes it then, or another one.
                lock(&self.tenants).entry(tenant.to_owned()).or_default().sessions.push_back(session);
            }
        }
    }
}

/// Approximate size of stored frames, in bytes.
fn stored_bytes(solved: &[SolvedFrame]) -> u64 {
    solved.iter().map(|s| frame_bytes(s.cage.len() / 3, s.posted.as_ref().map_or(0, Vec::len))).sum()
}

impl Session {
    /// Takes over solved frames, to be written soon.
    pub(crate) fn commit(self: &Arc<Self>, solved: Vec<SolvedFrame>) {
        if solved.is_empty() {
            return;
        }
        // Counted before writing, so that a slow disk cannot let a tenant exceed its quota.
        self.bytes.fetch_add(stored_bytes(&solved), Relaxed);
        let mut waiting = lock(&self.waiting);
        waiting.solved.extend(solved);
        if !waiting.busy {
            waiting.busy = true;
            drop(waiting);
            self.committer.enqueue(Arc::clone(self));
        }
    }

    /// Fails what waits to be stored.
    fn give_up_waiting(&self, error: &ApiError) {
        let solved = {
            let mut waiting = lock(&self.waiting);
            waiting.busy = false;
            std::mem::take(&mut waiting.solved)
        };
        self.bytes.fetch_sub(stored_bytes(&solved), Relaxed);
        self.give_up(&solved, error);
    }

    /// Stores frames and notifies their uploads.
    fn write(&self, solved: &[SolvedFrame]) {
        let solved = self.before_first_orphan(solved);
        if solved.is_empty() {
            return;
        }
        let mut records: Vec<NewFrame<'_>> =
            solved.iter().map(|s| NewFrame { entry: s.entry, cage: &s.cage }).collect();
        let mut is_unknown = lock(&self.appending);
        if let Phase::Failed(problem) = self.status().phase {
            drop(is_unknown);
            self.bytes.fetch_sub(stored_bytes(solved), Relaxed);
            self.give_up(solved, &ApiError::new(problem::SESSION_FAILED, problem.detail));
            return;
        }
        let mut found = 0;
        let known = if *is_unknown { self.load_frames() } else { Ok(()) };
        let outcome = known.and_then(|()| {
            // Loading may have found some of these frames; they are not stored again.
            records.retain(|record| self.frames().adds_information(&record.entry));
            found = (solved.len() - records.len()) as u64;
            // First what has to be coded: a frame that is stored, has been posted as its digest says.
            let posted: Vec<(u32, &[u8])> = solved
                .iter()
                .filter_map(|s| Some((s.entry.frame, s.posted.as_deref()?)))
                .filter(|(frame, _)| records.iter().any(|record| record.entry.frame == *frame))
                .collect();
            if !posted.is_empty() {
                self.keep_frames(&posted)?;
            }
            self.store.append_frames(&self.meta.id, &records)
        });
        // The answer may have been lost: then loading tells. What had no room was not stored.
        *is_unknown = outcome.as_ref().is_err_and(|error| !matches!(error, StoreError::Full { .. }));
        drop(is_unknown);
        match outcome {
            Ok(entries) => {
                // These were counted when they were found.
                self.bytes.fetch_sub(found * self.stored_frame_bytes(), Relaxed);
                let measured = entries.iter().filter(|entry| entry.full_digest.is_some()).count();
                for (rows, count) in [("all", measured), ("handles", entries.len() - measured)] {
                    metrics::counter!("cager_frames_total", "tenant" => self.meta.tenant.clone(), "rows" => rows)
                        .increment(count as u64);
                }
                for entry in entries {
                    let uploads = self.frames().solved(entry);
                    uploads.iter().for_each(|upload| upload.answer(entry.frame));
                }
            }
            Err(error) => {
                self.bytes.fetch_sub(stored_bytes(solved), Relaxed);
                if self.is_going() {
                    tracing::debug!(session = %self.meta.id, "the session was deleted before its frames were written");
                } else {
                    tracing::warn!(session = %self.meta.id, %error, "frames could not be written");
                }
                let error = self.fail_if_damaged(error);
                self.give_up(solved, &error);
            }
        }
        self.touch();
    }

    /// Bytes on disk of a frame, about.
    pub(super) fn stored_frame_bytes(&self) -> u64 {
        self.facts().map_or(0, |facts| {
            let posted = if self.goal().is_some() { 12 * facts.points as usize } else { 0 };
            frame_bytes(facts.unknowns as usize, posted)
        })
    }

    /// In sessions whose frames depend on their predecessors, returns the frames up to the first one whose predecessor is not written, and
    /// fails the rest: frames on disk must be computed from frames on disk.
    fn before_first_orphan<'a>(&self, solved: &'a [SolvedFrame]) -> &'a [SolvedFrame] {
        if !self.follows_previous() {
            return solved;
        }
        let there = |frame: u32, before: &[SolvedFrame]| {
            before.iter().any(|s| s.entry.frame == frame) || self.frames().entry(frame).is_some()
        };
        let orphan =
            (0..solved.len()).find(|&k| solved[k].entry.frame > 0 && !there(solved[k].entry.frame - 1, &solved[..k]));
        let (written, orphans) = solved.split_at(orphan.unwrap_or(solved.len()));
        if let Some(first) = orphans.first() {
            self.bytes.fetch_sub(stored_bytes(orphans), Relaxed);
            self.give_up(orphans, &predecessor_missing(first.entry.frame));
        }
        written
    }

    /// Fails the uploads that wait for these frames.
    fn give_up(&self, solved: &[SolvedFrame], error: &ApiError) {
        for s in solved {
            let uploads = self.frames().release_claim(s.entry.frame);
            uploads.iter().for_each(|upload| upload.fail(error.clone().frame(s.entry.frame)));
        }
    }
}

/// The error for a frame whose predecessor is not solved.
pub(crate) fn predecessor_missing(frame: u32) -> ApiError {
    let before = frame.saturating_sub(1);
    let detail = format!(
        "frame {frame} depends on frame {before} (the regularizer is temporal), which is not solved yet; post frames in order, frame {before} first"
    );
    ApiError::new(problem::FRAMES_MISSING, detail).frame(frame).missing(vec![[before, frame]])
}
