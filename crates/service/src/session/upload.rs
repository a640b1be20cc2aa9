//! State of one frame upload: what it has submitted and which answers are pending.

use super::Session;
use super::registry::Reserved;
use crate::admission::Permit;
use crate::problem::{self, ApiError};
use crate::sync::lock;
use cager_core::inversion::Rows;
use std::collections::VecDeque;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex};
use std::time::Instant;
use tokio::sync::{Notify, OwnedSemaphorePermit};
use tokio_util::sync::CancellationToken;

/// State of one frame upload. Pending answers are frame numbers only; their contents are read from the store.
#[derive(Default)]
pub(crate) struct Upload {
    state: Mutex<State>,
    changed: Notify,
    /// The client is gone.
    gone: CancellationToken,
    /// A frame failed, or the client is gone.
    aborted: CancellationToken,
}

#[derive(Default)]
struct State {
    answers: VecDeque<u32>,
    submitted: u64,
    finished: u64,
    closed: bool,
    error: Option<ApiError>,
}

/// The next part of an upload's response.
#[derive(Debug)]
pub(crate) enum UploadEvent {
    /// These frames are on disk.
    Frames(Vec<u32>),
    /// The upload failed; nothing follows.
    Failed(ApiError),
    /// All frames are answered; nothing follows.
    Done,
}

impl Upload {
    fn with<T>(&self, f: impl FnOnce(&mut State) -> T) -> T {
        let result = f(&mut lock(&self.state));
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

    /// A submitted frame failed. The first error is reported.
    pub(crate) fn fail(&self, error: ApiError) {
        self.with(|s| {
            s.finished += 1;
            s.error.get_or_insert(error);
        });
        self.aborted.cancel();
    }

    /// No more frames will be submitted: the body ended, or failed with this error.
    pub(crate) fn close(&self, error: Option<ApiError>) {
        self.with(|s| {
            s.closed = true;
            if let Some(error) = error {
                s.error.get_or_insert(error);
            }
        });
    }

    /// Whether a frame failed or the client is gone, so that the rest of the body need not be read.
    pub(crate) fn is_aborted(&self) -> bool {
        self.aborted.is_cancelled()
    }

    /// Waits until [`Self::is_aborted`].
    pub(crate) async fn aborted(&self) {
        self.aborted.cancelled().await;
    }

    /// The client is gone: queued frames need not be solved.
    pub(crate) fn abandon(&self) {
        self.gone.cancel();
        self.aborted.cancel();
    }

    pub(crate) fn is_abandoned(&self) -> bool {
        self.gone.is_cancelled()
    }

    /// Waits until no more frames will be submitted. For one caller at a time.
    pub(crate) async fn closed(&self) {
        while !lock(&self.state).closed {
            self.changed.notified().await;
        }
    }

    /// The next answers, at most `most`. For one caller at a time.
    pub(crate) async fn next(&self, most: usize) -> UploadEvent {
        loop {
            {
                let mut state = lock(&self.state);
                if !state.answers.is_empty() {
                    let count = most.min(state.answers.len());
                    return UploadEvent::Frames(state.answers.drain(..count).collect());
                }
                if state.closed && state.finished == state.submitted {
                    return state.error.take().map_or(UploadEvent::Done, UploadEvent::Failed);
                }
            }
            self.changed.notified().await;
        }
    }
}

/// A frame queued for solving.
pub(crate) struct FrameJob {
    pub(super) upload: Arc<Upload>,
    pub(super) frame: u32,
    pub(super) rows: Rows,
    /// Little-endian f32, three for each row.
    pub(super) bytes: Vec<u8>,
    /// Counter of queued frames that includes it until it is claimed.
    queued: Option<Arc<AtomicU64>>,
    pub(super) arrived: Instant,
    disarmed: bool,
    pub(super) permits: Option<Permits>,
}

/// Limits that a frame counts against.
pub(crate) struct Permits {
    /// A slot in the upload's window, a place among the frames that wait and memory, until it is solved, or on disk where it has to be coded.
    pub(crate) solving: Option<(OwnedSemaphorePermit, [Permit; 2])>,
    /// A slot in the upload's window of unwritten frames, until it is on disk.
    pub(crate) _writing: OwnedSemaphorePermit,
    /// Quota, until its session has counted it.
    pub(crate) quota: Option<Reserved>,
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
            disarmed: false,
            permits: Some(permits),
        }
    }

    /// Prevents the error on drop: its upload is notified in another way.
    pub(super) fn disarm(mut self) {
        self.disarmed = true;
    }

    pub(super) fn refuse(self, kind: problem::ProblemKind, detail: String) {
        let error = ApiError::new(kind, detail).frame(self.frame);
        self.fail(error);
    }

    pub(super) fn fail(self, error: ApiError) {
        let upload = Arc::clone(&self.upload);
        self.disarm();
        upload.fail(error);
    }

    pub(super) fn leave_queue(&mut self) {
        if let Some(queued) = self.queued.take() {
            queued.fetch_sub(1, Ordering::Relaxed);
        }
    }
}

impl Drop for FrameJob {
    fn drop(&mut self) {
        self.leave_queue();
        if !self.disarmed {
            self.upload.fail(if std::thread::panicking() {
                ApiError::internal(&format!("frame {} was not solved, because its batch panicked", self.frame))
            } else {
                let detail = format!("frame {} was not solved, because its session ended", self.frame);
                ApiError::new(problem::SESSION_DELETED, detail)
            });
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::panic::{AssertUnwindSafe, catch_unwind};

    #[tokio::test]
    async fn an_upload_ends_when_all_it_submitted_is_answered() {
        let upload = Upload::default();
        upload.with(|s| s.submitted = 2);
        upload.answer(7);
        assert!(matches!(upload.next(8).await, UploadEvent::Frames(frames) if frames == [7]));
        upload.close(None);
        upload.answer(9);
        assert!(matches!(upload.next(8).await, UploadEvent::Frames(frames) if frames == [9]));
        assert!(matches!(upload.next(8).await, UploadEvent::Done));
    }

    #[tokio::test]
    async fn an_upload_tells_its_answers_before_its_error() {
        let upload = Upload::default();
        upload.with(|s| s.submitted = 2);
        upload.fail(ApiError::new(problem::INVALID_FRAME, "first"));
        upload.answer(1);
        upload.close(Some(ApiError::new(problem::BAD_REQUEST, "second")));
        assert!(matches!(upload.next(8).await, UploadEvent::Frames(_)));
        assert!(matches!(upload.next(8).await, UploadEvent::Failed(e) if e.problem.detail == "first"));
    }

    #[test]
    fn a_frame_that_a_panic_loses_is_not_said_to_be_of_a_deleted_session() {
        for (panics, kind) in [(true, problem::INTERNAL), (false, problem::SESSION_DELETED)] {
            let upload = Arc::new(Upload::default());
            let job = FrameJob {
                upload: Arc::clone(&upload),
                frame: 3,
                rows: Rows::All,
                bytes: Vec::new(),
                queued: None,
                arrived: Instant::now(),
                disarmed: false,
                permits: None,
            };
            let work = AssertUnwindSafe(move || {
                let _job = job;
                assert!(!panics, "as a batch does");
            });
            assert_eq!(catch_unwind(work).is_err(), panics);
            let error = lock(&upload.state).error.clone().expect("an error");
            assert_eq!(error.status(), kind.status);
        }
    }
}
