//! One request that posts frames: what it submitted, and what it heard back.

use super::Session;
use crate::admission::Held;
use crate::problem::{self, ApiError};
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
    pub(super) upload: Arc<Upload>,
    pub(super) frame: u32,
    pub(super) rows: Rows,
    /// Little-endian f32, three for each row.
    pub(super) bytes: Vec<u8>,
    /// Where it counts as long as nobody has claimed its frame.
    queued: Option<Arc<AtomicU64>>,
    pub(super) arrived: Instant,
    settled: bool,
    pub(super) permits: Option<Permits>,
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
    pub(super) fn settle(mut self) {
        self.settled = true;
    }

    pub(super) fn fail(self, error: ApiError) {
        let upload = Arc::clone(&self.upload);
        self.settle();
        upload.fail(error);
    }
}

impl FrameJob {
    pub(super) fn leave_queue(&mut self) {
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

#[cfg(test)]
mod tests {
    use super::*;

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
