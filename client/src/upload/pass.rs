//! One request of an upload: sends frames and reads their results concurrently.

use super::Upload;
use super::answer::result;
use super::feed::{BodyChunks, FrameFeed, Layout, Outcome};
use super::live::{SendProgress, with_idle_timeout};
use super::set::FrameRange;
use crate::client::Client;
use crate::error::{ClientError, Failure};
use crate::lines::{Lines, TooLong};
use bytes::Bytes;
use cager_proto::messages::FrameResult;
use cager_proto::record;
use futures_util::stream;
use reqwest::header::{ACCEPT, CONTENT_TYPE};
use reqwest::{Body, Method, Response};
use std::convert::Infallible;
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::Duration;
use tokio::sync::{oneshot, watch};

/// How long a cautious request waits for an early refusal before it sends a frame, and then for that frame's result.
const CAUTION: [Duration; 2] = [Duration::from_millis(300), Duration::from_secs(1)];

/// How long the end of a response is awaited after the last result.
const END_TIMEOUT: Duration = Duration::from_secs(5);

/// What has been received from the service during a request.
const HEAD: u8 = 1;
const RESULT: u8 = 2;

impl From<TooLong> for Failure {
    fn from(_: TooLong) -> Self {
        Self::protocol("a line of it has no end")
    }
}

impl Upload<'_> {
    /// Sends the frames of `ranges` in one request and takes in their results; succeeds when all frames have one.
    ///
    /// A `cautious` request gives the service a moment to answer before it sends anything, and again after the first frame:
    /// a server that refuses a body over HTTP/1.1 closes the connection, and unread bytes on their way to it make the
    /// operating system throw its answer away. So the request after a broken one gives it time to be heard.
    pub(super) async fn pass(
        &mut self,
        feed: &FrameFeed,
        ranges: Vec<FrameRange>,
        cautious: bool,
    ) -> Result<(), Failure> {
        let client = self.client.clone();
        let live = self.live && client.is_live();
        // Records have checksums: some proxies lose bytes of a request whose answer has begun.
        let layout = if ranges.len() == 1 && !live { Layout::Raw } else { Layout::Records };
        let mut query = vec![("first", ranges.first().map_or(0, |range| range.first).to_string())];
        if self.by_handles {
            query.push(("rows", "handles".to_owned()));
        }
        if live {
            query.push(("live", "true".to_owned()));
        }
        let request = client.request(Method::POST, &["v1", "sessions", &self.id, "frames"], &query).await?;
        let media_type = match layout {
            Layout::Raw => "application/octet-stream",
            Layout::Records => record::MEDIA_TYPE,
        };
        let BodyChunks { pieces, mut outcome } = feed.read(ranges.clone(), layout, cautious)?;
        let (heard, hearing) = watch::channel(0);
        let sent = Arc::new(SendProgress { live, ..SendProgress::default() });
        let sending = RequestBody { pieces, sent: sent.clone(), caution: cautious.then_some((0, hearing)) };
        let request = request
            .header(CONTENT_TYPE, media_type)
            .header(ACCEPT, "application/x-ndjson")
            .body(Body::wrap_stream(stream::unfold(sending, RequestBody::next)));
        let answer = async {
            let response = client.accept(with_idle_timeout(&client, &sent, request.send()).await?).await?;
            heard.send_replace(HEAD);
            self.read_results(&client, response, &ranges, &sent, &heard, &mut outcome).await
        };
        let answer = answer.await;
        self.sent_bytes += sent.bytes.load(Ordering::Relaxed);
        let answer = match answer {
            Err(failure) if live => Err(self.after_live_failure(failure)),
            answer => answer,
        };
        // A problem in the response is more specific than an error of the source, and that more than a broken connection.
        if matches!(&answer, Err(failure) if failure.status().is_some()) {
            return answer;
        }
        self.read_outcome(&mut outcome)?;
        answer
    }

    async fn read_results(
        &mut self,
        client: &Client,
        mut response: Response,
        ranges: &[FrameRange],
        sent: &SendProgress,
        heard: &watch::Sender<u8>,
        outcome: &mut oneshot::Receiver<Outcome>,
    ) -> Result<(), Failure> {
        let mut lines = Lines::default();
        loop {
            let piece = if self.is_complete() {
                match tokio::time::timeout(END_TIMEOUT, response.chunk()).await {
                    Ok(Ok(Some(piece))) => Some(piece),
                    _ => None,
                }
            } else {
                let piece = with_idle_timeout(client, sent, response.chunk()).await?;
                piece.map_err(|error| client.network(&error))?
            };
            let Some(piece) = piece else { break };
            heard.send_replace(RESULT);
            lines.push(&piece, |line| self.line(line, ranges))?;
            self.read_outcome(outcome)?;
        }
        // The last line may lack its newline, but must be complete.
        if self.line(lines.rest(), ranges).is_err() {
            return Err(client.broken("the answer ended within a line"));
        }
        self.read_outcome(outcome)?;
        if self.is_complete() {
            return Ok(());
        }
        let missing = self.done.missing(self.total).first().map_or(0, |range| range.first);
        Err(client.broken(format!("the answer ended without a result for frame {missing}")))
    }

    fn line(&mut self, line: &[u8], ranges: &[FrameRange]) -> Result<(), Failure> {
        let Some(found) = result(line)? else { return Ok(()) };
        let FrameResult { frame, .. } = found;
        if !ranges.iter().any(|range| range.first <= frame && range.end.is_none_or(|end| frame < end)) {
            return Err(Failure::protocol(format!("it has a result for frame {frame}, which was not sent")));
        }
        self.report(found);
        self.done.insert(frame, frame.saturating_add(1));
        Ok(())
    }

    /// Checks whether reading has ended, and how.
    fn read_outcome(&mut self, outcome: &mut oneshot::Receiver<Outcome>) -> Result<(), ClientError> {
        match outcome.try_recv() {
            Ok(Ok(total)) => {
                self.total = total.or(self.total);
                Ok(())
            }
            Ok(Err(error)) => Err(error),
            Err(_) => Ok(()),
        }
    }
}

/// The body of the request.
struct RequestBody {
    pieces: tokio::sync::mpsc::Receiver<Bytes>,
    sent: Arc<SendProgress>,
    /// Stage of the cautious start, and where responses are signalled.
    caution: Option<(u8, watch::Receiver<u8>)>,
}

impl RequestBody {
    async fn next(mut self) -> Option<(Result<Bytes, Infallible>, Self)> {
        if let Some((stage, hearing)) = &mut self.caution
            && *stage < RESULT
        {
            let patience = CAUTION[usize::from(*stage)];
            *stage += 1;
            // A silent or disconnected service does not block the rest.
            let _ = tokio::time::timeout(patience, hearing.wait_for(|heard| *heard >= *stage)).await;
        }
        self.sent.starved.store(true, Ordering::Relaxed);
        let piece = self.pieces.recv().await;
        self.sent.starved.store(false, Ordering::Relaxed);
        let piece = piece?;
        self.sent.bytes.fetch_add(piece.len() as u64, Ordering::Relaxed);
        Some((Ok(piece), self))
    }
}
