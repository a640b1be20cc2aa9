//! One request of an upload: frames go out while results come back.

use super::Upload;
use super::answer::result;
use super::feed::{Feed, Layout, Outcome, Reading};
use super::live::{Sent, while_moving};
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

/// How long a cautious request waits for a refusal before it sends a frame, and then for that frame's result.
const CAUTION: [Duration; 2] = [Duration::from_millis(300), Duration::from_secs(1)];

/// How long the end of an answer is waited for that has nothing more to say.
const END_PATIENCE: Duration = Duration::from_secs(5);

/// What has been heard from the service during a request.
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
    pub(super) async fn pass(&mut self, feed: &Feed, ranges: Vec<FrameRange>, cautious: bool) -> Result<(), Failure> {
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
        let Reading { pieces, mut outcome } = feed.read(ranges.clone(), layout, cautious)?;
        let (heard, hearing) = watch::channel(0);
        let sent = Arc::new(Sent { live, ..Sent::default() });
        let sending = Sending { pieces, sent: sent.clone(), caution: cautious.then_some((0, hearing)) };
        let request = request
            .header(CONTENT_TYPE, media_type)
            .header(ACCEPT, "application/x-ndjson")
            .body(Body::wrap_stream(stream::unfold(sending, Sending::next)));
        let answer = async {
            let response = client.accept(while_moving(&client, &sent, request.send()).await?).await?;
            heard.send_replace(HEAD);
            self.take_in(&client, response, &ranges, &sent, &heard, &mut outcome).await
        };
        let answer = answer.await;
        self.sent_bytes += sent.bytes.load(Ordering::Relaxed);
        let answer = match answer {
            Err(failure) if live => Err(self.without_live(failure)),
            answer => answer,
        };
        // An answer that names a problem says more than the source, and the source more than a broken connection.
        if matches!(&answer, Err(failure) if failure.status().is_some()) {
            return answer;
        }
        self.read_outcome(&mut outcome)?;
        answer
    }

    async fn take_in(
        &mut self,
        client: &Client,
        mut response: Response,
        ranges: &[FrameRange],
        sent: &Sent,
        heard: &watch::Sender<u8>,
        outcome: &mut oneshot::Receiver<Outcome>,
    ) -> Result<(), Failure> {
        let mut lines = Lines::default();
        loop {
            let piece = if self.is_complete() {
                match tokio::time::timeout(END_PATIENCE, response.chunk()).await {
                    Ok(Ok(Some(piece))) => Some(piece),
                    _ => None,
                }
            } else {
                let piece = while_moving(client, sent, response.chunk()).await?;
                piece.map_err(|error| client.network(&error))?
            };
            let Some(piece) = piece else { break };
            heard.send_replace(RESULT);
            lines.push(&piece, |line| self.line(line, ranges))?;
            self.read_outcome(outcome)?;
        }
        // A last line may lack its end, but not its middle.
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

    /// Learns how reading ended, where it did.
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
struct Sending {
    pieces: tokio::sync::mpsc::Receiver<Bytes>,
    sent: Arc<Sent>,
    /// What the next piece waits for, and where it is heard.
    caution: Option<(u8, watch::Receiver<u8>)>,
}

impl Sending {
    async fn next(mut self) -> Option<(Result<Bytes, Infallible>, Self)> {
        if let Some((stage, hearing)) = &mut self.caution
            && *stage < RESULT
        {
            let patience = CAUTION[usize::from(*stage)];
            *stage += 1;
            // Neither a silent service nor one that is gone keeps the rest back.
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
