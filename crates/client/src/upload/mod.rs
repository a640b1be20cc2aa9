//! Uploading frames, with resumption after broken connections.

mod answer;
mod feed;
mod live;
mod pass;
mod set;

use crate::client::Client;
use crate::error::{ClientError, Failure};
use crate::problem::is_body_limit;
use crate::sessions::{known, reason};
use crate::source::FrameSource;
use cager_proto::messages::{FrameResult, Problem, Session, SessionState};
use feed::{FrameFeed, check_handles};
use set::FrameSet;
use std::time::Duration;

/// Which rows of a frame are sent.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Rows {
    /// All points: the service measures the error of every frame.
    #[default]
    All,
    /// Those that the inversion reads: little to send, the same cages, but no errors.
    Handles,
}

/// How frames are uploaded.
pub struct UploadOptions<'a> {
    /// Which rows of a frame are sent.
    pub rows: Rows,
    /// Called once with every frame's result; first with those that the session had already.
    pub on_frame: Option<&'a mut (dyn FnMut(FrameResult) + Send)>,
    /// Longest wait for a session that still prepares.
    pub ready_limit: Duration,
    /// Requests that send frames at the same time, over as many connections where HTTP/1.1 is spoken; one where frames depend on their
    /// predecessors. More than one is worth it where a connection is slower than the way to the service.
    pub connections: usize,
}

impl Default for UploadOptions<'_> {
    fn default() -> Self {
        Self { rows: Rows::All, on_frame: None, ready_limit: Duration::from_secs(600), connections: 1 }
    }
}

/// A finished upload.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Uploaded {
    /// Frames of the capture; the service has all of them, solved and on disk.
    pub frames: u32,
    /// Bytes of frames given to connections, more than once where one broke.
    pub sent_bytes: u64,
    /// Times that it began anew with what was missing.
    pub retries: u32,
}

impl Client {
    /// Uploads the frames that a session does not have yet, and returns when all of them are solved. Results come back while
    /// frames are sent; memory does not grow with their number. After a broken connection, a restart of the service or its
    /// request for patience, it goes on with what is missing. What is there is not compared, see [`Client::sent`]. Where a proxy in between stops sending a request whose answer has begun, this
    /// and later uploads of the client have their results at the end of each request. Where a proxy limits bodies, fewer frames are sent at a time, one request after the other.
    ///
    /// `source` is read on a thread of its own, for which it is handed over.
    ///
    /// # Errors
    /// [`ClientError::Mismatch`] where the frames do not fit the session, [`ClientError::Source`] where they cannot be read,
    /// [`ClientError::Refused`] where the service does not want them or a proxy does not let a single one through, and those of
    /// [`Client::wait_ready`] and the connection.
    /// Frames that have their result stay solved; another upload goes on from there.
    pub async fn upload<S: FrameSource + 'static>(
        &self,
        session: &Session,
        source: S,
        options: UploadOptions<'_>,
    ) -> Result<Uploaded, ClientError> {
        let session = self.wait_ready(&session.id, options.ready_limit).await?;
        let points = known(&session.id, "points", session.points).map_err(into_error)?;
        if source.points() != points as usize {
            let found = source.points();
            return Err(ClientError::Mismatch(format!(
                "the frames have {found} points, but the session's model has {points}; use a capture of the same mesh"
            )));
        }
        let handles = match options.rows {
            Rows::All => None,
            Rows::Handles => Some(self.handles(&session.id).await?),
        };
        check_handles(handles.as_deref().unwrap_or_default(), points)?;
        let rows = handles.as_ref().map_or(u64::from(points), |handles| handles.len() as u64);
        let mut upload = Upload {
            client: self.clone(),
            id: session.id.clone(),
            by_handles: handles.is_some(),
            live: true,
            total: source.frames(),
            done: FrameSet::default(),
            reported: FrameSet::default(),
            on_frame: options.on_frame,
            connections: if session.regularizer == TEMPORAL { 1 } else { options.connections.max(1) },
            sent_bytes: 0,
            largest_body: 0,
            frame_bytes: 12 * rows.max(1),
            most_frames: u32::MAX,
        };
        upload.synchronise(&session).await?;
        upload.run(&FrameFeed::start(source, handles)?).await
    }
}

/// The regularizer whose frames are solved in order.
const TEMPORAL: &str = "temporal";

/// An upload under way.
struct Upload<'a> {
    client: Client,
    id: String,
    by_handles: bool,
    /// Whether results are asked for while frames are sent.
    live: bool,
    /// Frames of the capture, where known.
    total: Option<u32>,
    /// Frames that the service has solved.
    done: FrameSet,
    /// Frames whose result the caller knows.
    reported: FrameSet,
    on_frame: Option<&'a mut (dyn FnMut(FrameResult) + Send)>,
    connections: usize,
    sent_bytes: u64,
    /// Bytes of the longest body of the last pass, as far as it was sent.
    largest_body: u64,
    frame_bytes: u64,
    /// Frames sent at a time, fewer than all where a proxy limits bodies.
    most_frames: u32,
}

impl Upload<'_> {
    async fn run(mut self, feed: &FrameFeed) -> Result<Uploaded, ClientError> {
        let mut backoff = self.client.backoff();
        let mut cautious = false;
        while !self.is_complete() {
            let before = self.done.len();
            let ranges = self.done.missing(self.total);
            let live = self.live;
            let passed = self.pass(feed, ranges, cautious).await;
            if !live && self.done.len() > before {
                // The retry without full duplex succeeded, so full duplex was at fault.
                self.client.disable_live();
            }
            let Err(mut failure) = passed else { continue };
            if let Failure::Final(ClientError::Refused(problem)) = &mut failure
                && is_body_limit(problem)
                && self.send_fewer(problem)
            {
                let session = self.client.session(&self.id).await?;
                self.synchronise(&session).await?;
                continue;
            }
            if self.done.len() > before {
                backoff.progress();
            }
            cautious = matches!(&failure, Failure::Transient { error: ClientError::Broken { .. }, .. });
            backoff.wait_after(failure).await?;
            let session = self.client.session(&self.id).await?;
            self.synchronise(&session).await?;
            if self.done.len() > before {
                backoff.progress();
            }
        }
        let frames = self.total.unwrap_or_else(|| self.done.end());
        Ok(Uploaded { frames, sent_bytes: self.sent_bytes, retries: backoff.total() })
    }

    /// Sends at most half as many frames at a time; false where a single one was too much, which `problem` says then.
    fn send_fewer(&mut self, problem: &mut Problem) -> bool {
        if self.most_frames == 1 {
            problem.detail = format!("a single frame of {} bytes is too much: {}", self.frame_bytes, problem.detail);
            return false;
        }
        let sent = u32::try_from(self.largest_body / self.frame_bytes).unwrap_or(u32::MAX);
        self.most_frames = (self.most_frames.min(sent) / 2).max(1);
        true
    }

    /// Synchronises with the frames that the service has, and reports results that were lost with a connection.
    async fn synchronise(&mut self, session: &Session) -> Result<(), ClientError> {
        if session.state == SessionState::Failed {
            return Err(ClientError::Failed(Box::new(reason(session.clone()))));
        }
        self.done = FrameSet::solved(&session.frames)
            .ok_or_else(|| ClientError::Protocol("the counts of its frames contradict each other".to_owned()))?;
        if session.state == SessionState::Completed {
            self.total = self.total.or(Some(self.done.end()));
        }
        if self.on_frame.is_some() && self.done.len() > self.reported.len() {
            for result in self.client.errors(&self.id).await? {
                self.report(result);
            }
        }
        Ok(())
    }

    fn report(&mut self, result: FrameResult) {
        let FrameResult { frame, .. } = result;
        if self.reported.insert(frame, frame.saturating_add(1))
            && let Some(on_frame) = &mut self.on_frame
        {
            on_frame(result);
        }
    }

    fn is_complete(&self) -> bool {
        self.total.is_some_and(|total| self.done.missing(Some(total)).is_empty())
    }
}

/// The error of a failure that is not retried.
fn into_error(failure: Failure) -> ClientError {
    match failure {
        Failure::Transient { error, .. } | Failure::Final(error) => error,
    }
}
