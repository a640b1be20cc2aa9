//! Solving posted frames in batches; the cages and errors are queued for writing.

use super::Session;
use super::commit::{SolvedFrame, predecessor_missing};
use super::frames::{Claim, Digests};
use super::upload::FrameJob;
use crate::preparation::Prepared;
use crate::problem::{self, ApiError};
use crate::sync::lock;
use cager_capture::capture::StoredError;
use cager_core::inversion::Rows;
use cager_proto::le;
use std::cell::RefCell;
use std::sync::Arc;
use std::time::Instant;

/// Values that a thread's frame buffers may keep allocated between batches.
const MAX_RETAINED_VALUES: usize = 4 << 20;

thread_local! {
    /// Buffers for frames as f32, reused between batches. Taken while in use, since rayon may start another batch on a waiting thread.
    static FRAME_BUFFERS: RefCell<Vec<Vec<f32>>> = const { RefCell::new(Vec::new()) };
}

/// Solves a batch and queues the results for writing.
pub(crate) fn solve(session: &Arc<Session>, prepared: &Prepared, jobs: Vec<FrameJob>) {
    if let Some(oldest) = jobs.iter().map(|job| job.arrived).min() {
        metrics::histogram!("cager_queue_seconds").record(oldest.elapsed().as_secs_f64());
    }
    let clock = Instant::now();
    let mut whole = Vec::new();
    let mut handles = Vec::new();
    let mut measured = Vec::new();
    for mut job in jobs {
        if job.upload.is_abandoned() || session.is_deleted() {
            continue;
        }
        if job.rows == Rows::Handles && session.goal().is_some() {
            let detail = "has handle rows only, and an error, a size or a quality was asked for; post it whole";
            let detail = format!("frame {}: {detail}", job.frame);
            job.refuse(problem::INVALID_FRAME, detail);
            continue;
        }
        let what = if job.rows == Rows::All { "point" } else { "handle" };
        if let Some(number) = le::first_not_finite(&job.bytes) {
            let row = number / 3;
            let detail = format!("frame {}: {what} {row} is not finite; export this frame again", job.frame);
            job.refuse(problem::INVALID_FRAME, detail);
            continue;
        }
        let is_first = job.frame == 0 || session.frames().is_empty();
        if let Some(detail) = prepared.reach.refusal_of_bytes(job.frame.into(), is_first, what, &job.bytes) {
            job.refuse(problem::INVALID_FRAME, detail);
            continue;
        }
        let digests = digests(prepared, &job);
        let claim = {
            let mut frames = session.frames();
            // Under the same lock as the claim, so that no frame is counted twice.
            job.leave_queue();
            frames.claim(job.frame, digests, &job.upload)
        };
        match claim {
            Claim::Solve if job.rows == Rows::All => whole.push((job, digests)),
            Claim::Solve => handles.push((job, digests)),
            Claim::Measure => measured.push((job, digests)),
            Claim::Waiting => job.disarm(),
            Claim::Known => {
                let (upload, frame) = (Arc::clone(&job.upload), job.frame);
                job.disarm();
                upload.answer(frame);
            }
            Claim::Sealed => {
                let detail =
                    format!("frame {} comes after the session was completed; make a new session for more", job.frame);
                job.refuse(problem::SESSION_COMPLETED, detail);
            }
            Claim::Conflict => {
                let error = conflict(job.frame);
                job.fail(error);
            }
        }
    }
    // From here on a guard releases the claims of frames that a panic leaves unfinished.
    let claimed = |(job, digests): (FrameJob, Digests)| {
        let guard = ClaimGuard { session, frames: vec![job.frame] };
        (job, digests, guard)
    };
    let measured: Vec<_> = measured.into_iter().map(claimed).collect();
    if prepared.solver.follows_previous() {
        solve_in_order(session, prepared, whole, handles);
    } else {
        let batches = [(Rows::All, whole), (Rows::Handles, handles)].map(|(rows, jobs)| {
            let guard = ClaimGuard { session, frames: jobs.iter().map(|(job, _)| job.frame).collect() };
            (rows, jobs, guard)
        });
        for (rows, jobs, guard) in batches {
            if !jobs.is_empty() {
                solve_batch(session, prepared, rows, jobs, None, guard);
            }
        }
    }
    measure(session, prepared, measured);
    metrics::histogram!("cager_solve_seconds").record(clock.elapsed().as_secs_f64());
}

/// Solves frames that each depend on their predecessor: runs of consecutive frames, each run starting from its predecessor's cage. Only one
/// batch of a session runs at a time.
fn solve_in_order(
    session: &Arc<Session>,
    prepared: &Prepared,
    whole: Vec<(FrameJob, Digests)>,
    handles: Vec<(FrameJob, Digests)>,
) {
    let mut jobs: Vec<(FrameJob, Digests)> = whole.into_iter().chain(handles).collect();
    jobs.sort_by_key(|(job, _)| job.frame);
    let mut guard = ClaimGuard { session, frames: jobs.iter().map(|(job, _)| job.frame).collect() };
    let mut jobs = jobs.into_iter().peekable();
    while let Some(first) = jobs.next() {
        let (frame, rows) = (first.0.frame, first.0.rows);
        let mut run = vec![first];
        while let Some(next) = jobs.next_if(|(job, _)| job.rows == rows && job.frame == frame + run.len() as u32) {
            run.push(next);
        }
        guard.frames.drain(..run.len());
        let own = ClaimGuard { session, frames: run.iter().map(|(job, _)| job.frame).collect() };
        match predecessor(session, frame) {
            Ok(previous) => solve_batch(session, prepared, rows, run, previous.as_deref(), own),
            Err(error) => fail_all(session, run, own, &error),
        }
    }
}

/// Measures frames whose cages were solved from handle rows, now that all rows are known. The cages do not change.
fn measure(session: &Arc<Session>, prepared: &Prepared, jobs: Vec<(FrameJob, Digests, ClaimGuard<'_>)>) {
    for (job, digests, guard) in jobs {
        let mut bytes = Vec::new();
        let entry = session.frames().entry(job.frame).copied();
        let read = entry.map_or_else(|| Err(conflict(job.frame)), |entry| session.read_cages(&[entry], &mut bytes));
        if let Err(error) = read {
            fail_all(session, vec![(job, digests)], guard, &error);
            continue;
        }
        let (cage, points) = (le::f32s(&bytes), le::f32s(&job.bytes));
        let errors = prepared.solver.decoder().measure(&[&cage], &[&points]);
        let error = StoredError::new(&errors[0], prepared.solver.diagonal());
        finish(session, vec![(job, digests)], vec![cage], vec![error], guard);
    }
}

fn fail_all(session: &Session, run: Vec<(FrameJob, Digests)>, mut guard: ClaimGuard<'_>, error: &ApiError) {
    guard.frames.clear();
    for (job, _) in run {
        for upload in session.frames().release_claim(job.frame) {
            upload.fail(error.clone());
        }
        job.disarm();
    }
}

/// The cage of the previous frame; `None` for frame 0.
fn predecessor(session: &Session, frame: u32) -> Result<Option<Vec<f32>>, ApiError> {
    let Some(before) = frame.checked_sub(1) else { return Ok(None) };
    if let Some((last, cage)) = &*lock(&session.last_solved)
        && *last == before
    {
        return Ok(Some(cage.clone()));
    }
    let Some(entry) = session.frames().entry(before).copied() else { return Err(predecessor_missing(frame)) };
    let mut bytes = Vec::new();
    session.read_cages(&[entry], &mut bytes)?;
    Ok(Some(le::f32s(&bytes)))
}

/// The error for a frame that was posted before with other content.
pub(crate) fn conflict(frame: u32) -> ApiError {
    let detail = format!(
        "frame {frame} was posted before with other content; what was posted first stays, so delete the session to start over"
    );
    ApiError::new(problem::FRAME_CONFLICT, detail).frame(frame)
}

fn solve_batch(
    session: &Arc<Session>,
    prepared: &Prepared,
    rows: Rows,
    jobs: Vec<(FrameJob, Digests)>,
    previous: Option<&[f32]>,
    guard: ClaimGuard<'_>,
) {
    let mut buffers = FRAME_BUFFERS.take();
    buffers.resize_with(buffers.len().max(jobs.len()), Vec::new);
    for ((job, _), buffer) in jobs.iter().zip(&mut buffers) {
        buffer.clear();
        buffer.extend(le::values(&job.bytes, f32::from_le_bytes));
    }
    let views: Vec<&[f32]> = buffers[..jobs.len()].iter().map(Vec::as_slice).collect();
    let solver = &prepared.solver;
    let cages: Vec<Vec<f32>> =
        solver.invert(rows, previous, &views).into_iter().map(|inverted| inverted.cage).collect();
    let errors = match rows {
        Rows::All => {
            let cage_views: Vec<&[f32]> = cages.iter().map(Vec::as_slice).collect();
            let errors = solver.decoder().measure(&cage_views, &views);
            errors.iter().map(|e| StoredError::new(e, solver.diagonal())).collect()
        }
        Rows::Handles => vec![StoredError::NOT_MEASURED; jobs.len()],
    };
    if buffers.iter().map(Vec::capacity).sum::<usize>() <= MAX_RETAINED_VALUES {
        FRAME_BUFFERS.set(buffers);
    }
    if solver.follows_previous() {
        let last = jobs.last().zip(cages.last()).map(|((job, _), cage)| (job.frame, cage.clone()));
        *lock(&session.last_solved) = last.filter(|(_, cage)| cage.iter().all(|x| x.is_finite()));
    }
    finish(session, jobs, cages, errors, guard);
}

/// Queues solved frames for writing; fails those that overflow single precision.
fn finish(
    session: &Arc<Session>,
    jobs: Vec<(FrameJob, Digests)>,
    cages: Vec<Vec<f32>>,
    errors: Vec<StoredError>,
    mut guard: ClaimGuard<'_>,
) {
    guard.frames.clear();
    let mut solved = Vec::with_capacity(jobs.len());
    let mut reserved = Vec::with_capacity(jobs.len());
    for (((mut job, digests), cage), error) in jobs.into_iter().zip(cages).zip(errors) {
        let frame = job.frame;
        let fits = cage.iter().all(|x| x.is_finite()) && (job.rows == Rows::Handles || error.linf.is_finite());
        if !fits {
            let detail =
                format!("frame {frame}: its numbers are too large for single precision; scale the capture down");
            for upload in session.frames().release_claim(frame) {
                upload.fail(ApiError::new(problem::INVALID_FRAME, detail.clone()).frame(frame));
            }
        } else {
            let posted = session.goal().map(|_| std::mem::take(&mut job.bytes));
            let mut permits = job.permits.take();
            reserved.extend(permits.as_mut().and_then(|permits| permits.quota.take()));
            if let (None, Some(permits)) = (&posted, &mut permits) {
                permits.solving = None;
            }
            solved.push(SolvedFrame { entry: digests.entry(frame, &error), cage, posted, _permits: permits });
        }
        job.disarm();
    }
    session.commit(solved);
    // Only now that the session has counted them.
    drop(reserved);
}

/// Releases the claims of frames that are not finished when it is dropped.
struct ClaimGuard<'a> {
    session: &'a Session,
    frames: Vec<u32>,
}

impl Drop for ClaimGuard<'_> {
    fn drop(&mut self) {
        for &frame in &self.frames {
            // Dropping a job notifies its own upload, the first in the list; the others are notified here.
            for upload in self.session.frames().release_claim(frame).into_iter().skip(1) {
                upload.fail(ApiError::internal(&"a batch of frames panicked"));
            }
        }
    }
}

fn digests(prepared: &Prepared, job: &FrameJob) -> Digests {
    let short = |hash: blake3::Hash| {
        let mut digest = [0; 16];
        digest.copy_from_slice(&hash.as_bytes()[..16]);
        digest
    };
    match job.rows {
        Rows::Handles => Digests { handles: short(blake3::hash(&job.bytes)), full: None },
        Rows::All => {
            let mut rows = Vec::with_capacity(12 * prepared.solver.handles().len());
            for &point in prepared.solver.handles() {
                rows.extend_from_slice(&job.bytes[12 * point as usize..][..12]);
            }
            Digests { handles: short(blake3::hash(&rows)), full: Some(short(blake3::hash(&job.bytes))) }
        }
    }
}
