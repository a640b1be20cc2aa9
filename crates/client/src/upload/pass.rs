//! One pass of an upload: sends frames and reads their results concurrently, by one request or several.

use super::Upload;
use super::answer::result;
use super::feed::{BodyChunks, FrameFeed, Layout, Outcome, PIECE_BYTES};
use super::live::{SendProgress, with_idle_timeout};
use super::set::FrameRange;
use crate::client::Client;
use crate::error::{ClientError, Failure};
use crate::lines::{Lines, TooLong};
use bytes::Bytes;
use cager_proto::messages::FrameResult;
use cager_proto::record;
use futures_util::future::try_join_all;
use futures_util::stream;
use reqwest::header::{ACCEPT, CONTENT_TYPE};
use reqwest::{Body, Method};
use std::convert::Infallible;
use std::sync::atomic::Ordering;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;
use tokio::sync::{mpsc, oneshot, watch};

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
    /// Sends the frames of `ranges` and takes in their results; succeeds when all frames have one. Several requests at the same time
    /// take the next frames as each of them has room.
    ///
    /// A `cautious` pass is one request and gives the service a moment to answer before it sends anything, and again after the first frame:
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
        let connections = if cautious || self.most_frames < u32::MAX { 1 } else { self.connections };
        let before = self.done.len();
        // Records have numbers, and checksums: some proxies lose bytes of a request whose answer has begun.
        let layout = if ranges.len() == 1 && !live && connections == 1 { Layout::Raw } else { Layout::Records };
        let BodyChunks { pieces, outcome } = feed.read(ranges.clone(), layout, self.most_frames, cautious)?;
        let pieces = Arc::new(tokio::sync::Mutex::new(pieces));
        let first = ranges.first().map_or(0, |range| range.first);
        let sent: Vec<_> =
            (0..connections).map(|_| Arc::new(SendProgress { live, ..SendProgress::default() })).collect();
        let pass = Mutex::new(Pass { upload: &mut *self, ranges, outcome });
        let requests = sent.iter().map(|sent| {
            let (heard, hearing) = watch::channel(0);
            let caution = cautious.then_some((0, hearing));
            let body = RequestBody { pieces: pieces.clone(), rest: Bytes::new(), sent: sent.clone(), caution };
            request(&client, &pass, first, layout, body, heard)
        });
        let answer = try_join_all(requests).await.map(|_| ());
        // Its frames are abandoned with the requests.
        drop(pieces);
        let Pass { mut outcome, .. } = pass.into_inner().unwrap_or_else(PoisonError::into_inner);
        let sent = || sent.iter().map(|sent| sent.bytes.load(Ordering::Relaxed));
        self.sent_bytes += sent().sum::<u64>();
        self.largest_body = sent().max().unwrap_or(0);
        let answer = match answer {
            Err(failure) if live => Err(self.after_live_failure(failure)),
            answer => answer,
        };
        // A problem in the response is more specific than an error of the source, and that more than a broken connection.
        if matches!(&answer, Err(failure) if failure.status().is_some()) {
            return answer;
        }
        self.read_outcome(&mut outcome)?;
        answer?;
        if self.is_complete() || self.done.len() - before >= u64::from(self.most_frames) {
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

/// What the requests of a pass share.
struct Pass<'a, 'b> {
    upload: &'a mut Upload<'b>,
    ranges: Vec<FrameRange>,
    outcome: oneshot::Receiver<Outcome>,
}

impl Pass<'_, '_> {
    fn lines(&mut self, lines: &mut Lines, piece: &[u8]) -> Result<(), Failure> {
        lines.push(piece, |line| self.upload.line(line, &self.ranges))?;
        Ok(self.upload.read_outcome(&mut self.outcome)?)
    }
}

/// Sends one request and takes in its results.
async fn request(
    client: &Client,
    pass: &Mutex<Pass<'_, '_>>,
    first: u32,
    layout: Layout,
    body: RequestBody,
    heard: watch::Sender<u8>,
) -> Result<(), Failure> {
    let lock = || pass.lock().unwrap_or_else(PoisonError::into_inner);
    let sent = body.sent.clone();
    let (id, by_handles) = {
        let pass = lock();
        (pass.upload.id.clone(), pass.upload.by_handles)
    };
    let mut query = vec![("first", first.to_string())];
    if by_handles {
        query.push(("rows", "handles".to_owned()));
    }
    if sent.live {
        query.push(("live", "true".to_owned()));
    }
    let media_type = match layout {
        Layout::Raw => "application/octet-stream",
        Layout::Records => record::MEDIA_TYPE,
    };
    let request = client.request(Method::POST, &["v1", "sessions", &id, "frames"], &query).await?;
    let request = request
        .header(CONTENT_TYPE, media_type)
        .header(ACCEPT, "application/x-ndjson")
        .body(Body::wrap_stream(stream::unfold(body, RequestBody::next)));
    let mut response = client.accept(with_idle_timeout(client, &sent, request.send()).await?).await?;
    heard.send_replace(HEAD);
    let mut lines = Lines::default();
    loop {
        let is_complete = lock().upload.is_complete();
        let piece = if is_complete {
            match tokio::time::timeout(END_TIMEOUT, response.chunk()).await {
                Ok(Ok(Some(piece))) => Some(piece),
                _ => None,
            }
        } else {
            let piece = with_idle_timeout(client, &sent, response.chunk()).await?;
            piece.map_err(|error| client.network(&error))?
        };
        let Some(piece) = piece else { break };
        heard.send_replace(RESULT);
        lock().lines(&mut lines, &piece)?;
    }
    let mut pass = lock();
    let Pass { upload, ranges, outcome } = &mut *pass;
    // The last line may lack its newline, but must be complete.
    if upload.line(lines.rest(), ranges).is_err() {
        return Err(client.broken("the answer ended within a line"));
    }
    Ok(upload.read_outcome(outcome)?)
}

/// The body of a request.
struct RequestBody {
    pieces: Arc<tokio::sync::Mutex<mpsc::Receiver<Bytes>>>,
    /// What is left of a chunk.
    rest: Bytes,
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
        if self.rest.is_empty() {
            self.sent.starved.store(true, Ordering::Relaxed);
            let piece = self.pieces.lock().await.recv().await;
            self.sent.starved.store(false, Ordering::Relaxed);
            self.rest = piece?;
        }
        // A large frame is split.
        let piece = self.rest.split_to(self.rest.len().min(2 * PIECE_BYTES));
        self.sent.bytes.fetch_add(piece.len() as u64, Ordering::Relaxed);
        Some((Ok(piece), self))
    }
}
