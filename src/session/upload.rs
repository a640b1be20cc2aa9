//! One request that posts frames, and the solving of what it posts.

use super::Session;
use super::commit::Solved;
use super::frames::{Claim, Digests};
use super::prepared::Prepared;
use crate::admission::Held;
use crate::capture::StoredError;
use crate::problem::{self, ApiError};
use std::cell::RefCell;
use std::collections::VecDeque;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex};
use std::time::Instant;
use tokio::sync::{Notify, OwnedSemaphorePermit};
use tokio_util::sync::CancellationToken;

/// What an upload has submitted and heard back. Answers that nobody has read yet are frame numbers; what they say waits in
/// the log.
#[derive(Default)]
pub(crate) struct Upload {
    state: Mutex<State>,
    changed: Notify,
    /// The client is gone.
    gone: CancellationToken,
    /// Something failed, or the client is gone.
    pointless: CancellationToken,
}

#[derive(Default)]
struct State {
    answers: VecDeque<u32>,
    submitted: u64,
    finished: u64,
    closed: bool,
    error: Option<ApiError>,
}

/// What comes next in the answer to an upload.
#[derive(Debug)]
pub(crate) enum Step {
    /// These frames are on disk.
    Frames(Vec<u32>),
    /// Nothing more; why.
    Failed(ApiError),
    /// Nothing more; all is done.
    Done,
}

impl Upload {
    fn with<T>(&self, f: impl FnOnce(&mut State) -> T) -> T {
        let result = f(&mut super::lock(&self.state));
        self.changed.notify_one();
        result
    }

    /// The frame is on disk.
    pub(crate) fn answer(&self, frame: u32) {
        self.with(|s| {
            s.finished += 1;
            s.answers.push_back(frame);
        });
    }

    /// A submitted frame came to nothing. The first reason counts.
    pub(crate) fn fail(&self, error: ApiError) {
        self.with(|s| {
            s.finished += 1;
            s.error.get_or_insert(error);
        });
        self.pointless.cancel();
    }

    /// No more frames will be submitted, because the body ended or for this reason.
    pub(crate) fn close(&self, error: Option<ApiError>) {
        self.with(|s| {
            s.closed = true;
            if let Some(error) = error {
                s.error.get_or_insert(error);
            }
        });
    }

    /// Whether something failed or the client went away, so that reading more makes no sense.
    pub(crate) fn is_pointless(&self) -> bool {
        self.pointless.is_cancelled()
    }

    /// As [`Self::is_pointless`], as soon as it is so.
    pub(crate) async fn pointless(&self) {
        self.pointless.cancelled().await;
    }

    /// The client went away: what waits is not worth solving.
    pub(crate) fn abandon(&self) {
        self.gone.cancel();
        self.pointless.cancel();
    }

    pub(crate) fn is_abandoned(&self) -> bool {
        self.gone.is_cancelled()
    }

    /// Waits until no more frames will be submitted. For one caller at a time.
    pub(crate) async fn closed(&self) {
        while !super::lock(&self.state).closed {
            self.changed.notified().await;
        }
    }

    /// The next answers, at most `most`. For one caller at a time.
    pub(crate) async fn next(&self, most: usize) -> Step {
        loop {
            {
                let mut state = super::lock(&self.state);
                if !state.answers.is_empty() {
                    let count = most.min(state.answers.len());
                    return Step::Frames(state.answers.drain(..count).collect());
                }
                if state.closed && state.finished == state.submitted {
                    return state.error.take().map_or(Step::Done, Step::Failed);
                }
            }
            self.changed.notified().await;
        }
    }
}

/// What a posted frame consists of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Rows {
    /// Every point of the model.
    All,
    /// The handles.
    Handles,
}

/// A frame on its way to a batch.
pub(crate) struct FrameJob {
    upload: Arc<Upload>,
    frame: u32,
    rows: Rows,
    /// Little-endian f32, three for each row.
    bytes: Vec<u8>,
    /// Where it counts as long as nobody has claimed its frame.
    queued: Option<Arc<AtomicU64>>,
    arrived: Instant,
    settled: bool,
    permits: Option<Permits>,
}

/// What a frame takes of what there is for all.
pub(crate) struct Permits {
    /// A place and memory, until it is solved.
    pub(crate) _solving: (OwnedSemaphorePermit, Held),
    /// A place until it is on disk.
    pub(crate) writing: OwnedSemaphorePermit,
}

impl FrameJob {
    pub(crate) fn new(
        session: &Session,
        upload: &Arc<Upload>,
        frame: u32,
        rows: Rows,
        bytes: Vec<u8>,
        permits: Permits,
    ) -> Self {
        session.queued.fetch_add(1, Ordering::Relaxed);
        upload.with(|s| s.submitted += 1);
        Self {
            upload: Arc::clone(upload),
            frame,
            rows,
            bytes,
            queued: Some(Arc::clone(&session.queued)),
            arrived: Instant::now(),
            settled: false,
            permits: Some(permits),
        }
    }

    /// Its upload will hear of it another way.
    fn settle(mut self) {
        self.settled = true;
    }

    fn fail(self, error: ApiError) {
        let upload = Arc::clone(&self.upload);
        self.settle();
        upload.fail(error);
    }
}

impl FrameJob {
    fn leave_queue(&mut self) {
        if let Some(queued) = self.queued.take() {
            queued.fetch_sub(1, Ordering::Relaxed);
        }
    }
}

impl Drop for FrameJob {
    fn drop(&mut self) {
        self.leave_queue();
        if !self.settled {
            self.upload.fail(ApiError::new(
                problem::SESSION_DELETED,
                format!("frame {} was not solved, because its session ended", self.frame),
            ));
        }
    }
}

/// Numbers that a thread keeps room for: frames of models beyond that are rare.
const KEPT_NUMBERS: usize = 4 << 20;

thread_local! {
    /// Frames as numbers: big, so kept. Taken out while in use, as a thread may start a batch while it waits within another.
    static NUMBERS: RefCell<Vec<Vec<f32>>> = const { RefCell::new(Vec::new()) };
}

/// Solves a batch and hands it on to be written.
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
        if let Some(row) = first_not_finite(&job.bytes) {
            let what = if job.rows == Rows::All { "point" } else { "handle" };
            let (frame, detail) =
                (job.frame, format!("frame {}: {what} {row} is not finite; export this frame again", job.frame));
            job.fail(ApiError::new(problem::INVALID_FRAME, detail).frame(frame));
            continue;
        }
        let digests = digests(prepared, &job);
        let claim = {
            let mut frames = session.frames();
            // At once, so that no frame counts twice.
            job.leave_queue();
            frames.claim(job.frame, digests, &job.upload)
        };
        match claim {
            Claim::Solve if job.rows == Rows::All => whole.push((job, digests)),
            Claim::Solve => handles.push((job, digests)),
            Claim::Measure => measured.push((job, digests)),
            Claim::Waiting => job.settle(),
            Claim::Known => {
                let (upload, frame) = (Arc::clone(&job.upload), job.frame);
                job.settle();
                upload.answer(frame);
            }
            Claim::Sealed => {
                let frame = job.frame;
                let detail =
                    format!("frame {frame} comes after the session was completed; make a new session for more");
                job.fail(ApiError::new(problem::SESSION_COMPLETED, detail).frame(frame));
            }
            Claim::Conflict => {
                let error = conflict(job.frame);
                job.fail(error);
            }
        }
    }
    // A panic must not leave these frames claimed for ever.
    let claimed = |(job, digests): (FrameJob, Digests)| {
        let guard = GiveUp { session, frames: vec![job.frame] };
        (job, digests, guard)
    };
    let measured: Vec<_> = measured.into_iter().map(claimed).collect();
    if prepared.solver.follows_previous() {
        solve_in_order(session, prepared, whole, handles);
        return measure(session, prepared, measured);
    }
    let batches = [(Rows::All, whole), (Rows::Handles, handles)].map(|(rows, jobs)| {
        let guard = GiveUp { session, frames: jobs.iter().map(|(job, _)| job.frame).collect() };
        (rows, jobs, guard)
    });
    for (rows, jobs, guard) in batches {
        if !jobs.is_empty() {
            solve_alike(session, prepared, rows, jobs, None, guard);
        }
    }
    measure(session, prepared, measured);
    metrics::histogram!("cager_solve_seconds").record(clock.elapsed().as_secs_f64());
}

/// Solves frames of which each depends on the one before: runs of consecutive frames, each after its predecessor's cage. Of a
/// session's batches only one runs at a time.
fn solve_in_order(
    session: &Arc<Session>,
    prepared: &Prepared,
    whole: Vec<(FrameJob, Digests)>,
    handles: Vec<(FrameJob, Digests)>,
) {
    let mut jobs: Vec<(FrameJob, Digests)> = whole.into_iter().chain(handles).collect();
    jobs.sort_by_key(|(job, _)| job.frame);
    let mut guard = GiveUp { session, frames: jobs.iter().map(|(job, _)| job.frame).collect() };
    let mut jobs = jobs.into_iter().peekable();
    while let Some(first) = jobs.next() {
        let (frame, rows) = (first.0.frame, first.0.rows);
        let mut run = vec![first];
        while let Some(next) = jobs.next_if(|(job, _)| job.rows == rows && job.frame == frame + run.len() as u32) {
            run.push(next);
        }
        guard.frames.drain(..run.len());
        let own = GiveUp { session, frames: run.iter().map(|(job, _)| job.frame).collect() };
        match predecessor(session, frame) {
            Ok(previous) => solve_alike(session, prepared, rows, run, previous.as_deref(), own),
            Err(error) => fail_all(session, run, own, &error),
        }
    }
}

/// Measures whole frames whose cages are there from their handle rows. The cages stay as they are.
fn measure(session: &Arc<Session>, prepared: &Prepared, jobs: Vec<(FrameJob, Digests, GiveUp<'_>)>) {
    for (job, digests, guard) in jobs {
        let mut bytes = Vec::new();
        let entry = session.frames().entry(job.frame).copied();
        let read = entry.map_or_else(|| Err(conflict(job.frame)), |entry| session.read_cages(&[entry], &mut bytes));
        if let Err(error) = read {
            fail_all(session, vec![(job, digests)], guard, &error);
            continue;
        }
        let numbers =
            |bytes: &[u8]| -> Vec<f32> { bytes.as_chunks().0.iter().map(|&b| f32::from_le_bytes(b)).collect() };
        let (cage, points) = (numbers(&bytes), numbers(&job.bytes));
        let errors = prepared.solver.decoder().measure(&[&cage], &[&points]);
        let error = StoredError::new(&errors[0], prepared.solver.diagonal());
        finish(session, vec![(job, digests)], vec![cage], vec![error], guard);
    }
}

fn fail_all(session: &Session, run: Vec<(FrameJob, Digests)>, mut guard: GiveUp<'_>, error: &ApiError) {
    guard.frames.clear();
    for (job, _) in run {
        for upload in session.frames().gave_up(job.frame) {
            upload.fail(error.clone());
        }
        job.settle();
    }
}

/// The cage of the frame before, where there is one.
fn predecessor(session: &Session, frame: u32) -> Result<Option<Vec<f32>>, ApiError> {
    let Some(before) = frame.checked_sub(1) else { return Ok(None) };
    if let Some((last, cage)) = &*super::lock(&session.last_solved)
        && *last == before
    {
        return Ok(Some(cage.clone()));
    }
    let Some(entry) = session.frames().entry(before).copied() else { return Err(predecessor_missing(frame)) };
    let mut bytes = Vec::new();
    session.read_cages(&[entry], &mut bytes)?;
    Ok(Some(bytes.as_chunks().0.iter().map(|&b| f32::from_le_bytes(b)).collect()))
}

/// What a client hears whose frame comes before the one that it depends on.
pub(crate) fn predecessor_missing(frame: u32) -> ApiError {
    let before = frame.saturating_sub(1);
    let detail = format!(
        "frame {frame} depends on frame {before} (the regularizer is temporal), which is not solved yet; post frames in order, frame {before} first"
    );
    ApiError::new(problem::FRAMES_MISSING, detail).frame(frame).missing(vec![[before, frame]])
}

/// What a client hears whose frame is there already with other content.
pub(crate) fn conflict(frame: u32) -> ApiError {
    let detail = format!(
        "frame {frame} was posted before with other content; what was posted first stays, so delete the session to start over"
    );
    ApiError::new(problem::FRAME_CONFLICT, detail).frame(frame)
}

fn solve_alike(
    session: &Arc<Session>,
    prepared: &Prepared,
    rows: Rows,
    jobs: Vec<(FrameJob, Digests)>,
    previous: Option<&[f32]>,
    guard: GiveUp<'_>,
) {
    let mut numbers = NUMBERS.take();
    numbers.resize_with(numbers.len().max(jobs.len()), Vec::new);
    for ((job, _), numbers) in jobs.iter().zip(&mut numbers) {
        numbers.clear();
        numbers.extend(job.bytes.chunks_exact(4).map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]])));
    }
    let views: Vec<&[f32]> = numbers[..jobs.len()].iter().map(Vec::as_slice).collect();
    let solver = &prepared.solver;
    let (cages, errors) = match rows {
        Rows::All => {
            let cages = solver.invert_after(previous, &views);
            let cage_views: Vec<&[f32]> = cages.iter().map(Vec::as_slice).collect();
            let errors = solver.decoder().measure(&cage_views, &views);
            (cages, errors.iter().map(|e| StoredError::new(e, solver.diagonal())).collect())
        }
        Rows::Handles => (solver.invert_handles_after(previous, &views), vec![StoredError::NOT_MEASURED; jobs.len()]),
    };
    if numbers.iter().map(Vec::capacity).sum::<usize>() <= KEPT_NUMBERS {
        NUMBERS.set(numbers);
    }
    if solver.follows_previous() {
        let last = jobs.last().zip(cages.last()).map(|((job, _), cage)| (job.frame, cage.clone()));
        *super::lock(&session.last_solved) = last.filter(|(_, cage)| cage.iter().all(|x| x.is_finite()));
    }
    finish(session, jobs, cages, errors, guard);
}

/// Hands what was solved on to be written.
fn finish(
    session: &Arc<Session>,
    jobs: Vec<(FrameJob, Digests)>,
    cages: Vec<Vec<f32>>,
    errors: Vec<StoredError>,
    mut guard: GiveUp<'_>,
) {
    guard.frames.clear();
    let mut solved = Vec::with_capacity(jobs.len());
    for (((mut job, digests), cage), error) in jobs.into_iter().zip(cages).zip(errors) {
        let frame = job.frame;
        let fits = cage.iter().all(|x| x.is_finite()) && (job.rows == Rows::Handles || error.linf.is_finite());
        if !fits {
            let detail =
                format!("frame {frame}: its numbers are too large for single precision; scale the capture down");
            for upload in session.frames().gave_up(frame) {
                upload.fail(ApiError::new(problem::INVALID_FRAME, detail.clone()).frame(frame));
            }
        } else {
            let permit = job.permits.take().map(|permits| permits.writing);
            solved.push(Solved { frame, digests, error, cage, _permit: permit });
        }
        job.settle();
    }
    session.commit(solved);
}

/// Frees claimed frames when a batch does not come to its end.
struct GiveUp<'a> {
    session: &'a Session,
    frames: Vec<u32>,
}

impl Drop for GiveUp<'_> {
    fn drop(&mut self) {
        for &frame in &self.frames {
            // The jobs tell their own uploads; those that waited with them hear it here.
            for upload in self.session.frames().gave_up(frame).into_iter().skip(1) {
                upload.fail(ApiError::internal(&"a batch of frames panicked"));
            }
        }
    }
}

fn first_not_finite(bytes: &[u8]) -> Option<usize> {
    // The exponent of NaN and infinity is all ones; without a branch this runs at the speed of memory.
    let suspicious = |b: &[u8]| u8::from(b[3] & 0x7f == 0x7f && b[2] & 0x80 == 0x80);
    if bytes.chunks_exact(4).fold(0, |any, b| any | suspicious(b)) == 0 {
        return None;
    }
    bytes.chunks_exact(4).position(|b| suspicious(b) == 1).map(|k| k / 3)
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_that_are_not_finite_are_found() {
        let bytes = |values: &[f32]| values.iter().flat_map(|x| x.to_le_bytes()).collect::<Vec<u8>>();
        assert_eq!(first_not_finite(&bytes(&[0.0, -1.5, f32::MAX, f32::MIN_POSITIVE, 1e-45, f32::MIN])), None);
        assert_eq!(first_not_finite(&bytes(&[0.0, 0.0, 0.0, 1.0, f32::NAN, 0.0])), Some(1));
        assert_eq!(first_not_finite(&bytes(&[f32::NEG_INFINITY, 0.0, 0.0])), Some(0));
    }

    #[tokio::test]
    async fn an_upload_ends_when_all_it_submitted_is_answered() {
        let upload = Upload::default();
        upload.with(|s| s.submitted = 2);
        upload.answer(7);
        assert!(matches!(upload.next(8).await, Step::Frames(frames) if frames == [7]));
        upload.close(None);
        upload.answer(9);
        assert!(matches!(upload.next(8).await, Step::Frames(frames) if frames == [9]));
        assert!(matches!(upload.next(8).await, Step::Done));
    }

    #[tokio::test]
    async fn an_upload_tells_its_answers_before_its_error() {
        let upload = Upload::default();
        upload.with(|s| s.submitted = 2);
        upload.fail(ApiError::new(problem::INVALID_FRAME, "first"));
        upload.answer(1);
        upload.close(Some(ApiError::new(problem::BAD_REQUEST, "second")));
        assert!(matches!(upload.next(8).await, Step::Frames(_)));
        assert!(matches!(upload.next(8).await, Step::Failed(e) if e.problem.detail == "first"));
    }
}
