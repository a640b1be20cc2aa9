//! Solved cages as a stream that reconnects.

use crate::backoff::Backoff;
use crate::body::{BodyEvent, listen};
use crate::client::Client;
use crate::error::{ClientError, Failure};
use crate::records::{CageFrame, CageRecords};
use crate::sessions::{known, reason};
use cager_proto::messages::SessionState;
use cager_proto::record::{MEDIA_TYPE, RecordError};
use futures_util::stream::BoxStream;
use futures_util::{StreamExt, TryStreamExt, stream};
use reqwest::header::ACCEPT;
use reqwest::{Method, Response};
use std::time::Duration;

/// Pause before a stream that the server ended is asked for again.
const RECONNECT: Duration = Duration::from_secs(1);

impl Client {
    /// Cages from frame `first` on, in order, as they are solved, until the session is complete. A broken connection is taken
    /// up again at the next frame.
    ///
    /// An error, such as [`ClientError::Refused`] for a session that was deleted, ends the stream.
    pub fn follow(&self, id: &str, first: u32) -> BoxStream<'static, Result<CageFrame, ClientError>> {
        self.cage_stream(id, first, Until::Completed)
    }

    /// The cages of `count` frames from `first` on.
    ///
    /// # Errors
    /// [`ClientError::Refused`] with status 409 and the missing ranges where not all of them are solved, and those of the
    /// connection.
    pub async fn cages(&self, id: &str, first: u32, count: u32) -> Result<Vec<CageFrame>, ClientError> {
        let end = first.saturating_add(count);
        if first == end {
            return Ok(Vec::new());
        }
        self.cage_stream(id, first, Until::Frame(end)).try_collect().await
    }

    fn cage_stream(&self, id: &str, first: u32, until: Until) -> BoxStream<'static, Result<CageFrame, ClientError>> {
        let (id, backoff) = (id.to_owned(), self.backoff());
        let cages = Cages { client: self.clone(), id, next: first, until, rows: None, connection: None, backoff };
        stream::try_unfold(cages, async |mut cages| Ok(cages.next().await?.map(|cage| (cage, cages)))).boxed()
    }
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Until {
    Completed,
    /// The frame after the last.
    Frame(u32),
}

struct Cages {
    client: Client,
    id: String,
    next: u32,
    until: Until,
    rows: Option<u32>,
    connection: Option<(Response, CageRecords)>,
    backoff: Backoff,
}

/// Result of one poll of the stream.
enum Step {
    Cage(CageFrame),
    End,
    /// Nothing yet; look again.
    Wait,
}

impl Cages {
    async fn next(&mut self) -> Result<Option<CageFrame>, ClientError> {
        loop {
            if self.until == Until::Frame(self.next) {
                return Ok(None);
            }
            match self.step().await {
                Ok(Step::Cage(cage)) => {
                    self.backoff.progress();
                    self.next = cage.frame.saturating_add(1);
                    return Ok(Some(cage));
                }
                Ok(Step::End) => return Ok(None),
                Ok(Step::Wait) => {}
                Err(failure) => {
                    self.connection = None;
                    self.backoff.wait_after(failure).await?;
                }
            }
        }
    }

    async fn step(&mut self) -> Result<Step, Failure> {
        if self.connection.is_none() {
            self.connection = Some(self.connect().await?);
        }
        let Some((response, records)) = &mut self.connection else { return Ok(Step::Wait) };
        match records.next() {
            Ok(Some(cage)) => return self.check(cage).map(Step::Cage),
            Ok(None) => {}
            // Corrupted in transit; request it again.
            Err(error @ RecordError::Checksum { .. }) => return Err(self.client.broken(error.to_string())),
            Err(error) => return Err(Failure::protocol(error.to_string())),
        }
        match listen(&self.client, response).await? {
            BodyEvent::Piece(piece) => {
                records.push(&piece);
                Ok(Step::Wait)
            }
            BodyEvent::End if records.pending() > 0 => Err(self.client.broken("the stream ended within a frame")),
            BodyEvent::End => self.ended().await,
            // A follower may wait long for the next frame, but not on a connection that may be dead.
            BodyEvent::Idle if self.until == Until::Completed && records.pending() == 0 => {
                self.connection = None;
                Ok(Step::Wait)
            }
            BodyEvent::Idle => Err(self.client.stalled()),
        }
    }

    fn check(&self, cage: CageFrame) -> Result<CageFrame, Failure> {
        let in_place = match self.until {
            Until::Completed => cage.frame == self.next,
            Until::Frame(end) => (self.next..end).contains(&cage.frame),
        };
        if in_place {
            Ok(cage)
        } else {
            Err(Failure::protocol(format!("frame {} came where frame {} was expected", cage.frame, self.next)))
        }
    }

    async fn connect(&mut self) -> Result<(Response, CageRecords), Failure> {
        let rows = match self.rows {
            Some(rows) => rows,
            None => known(&self.id, "unknowns", self.client.session(&self.id).await?.unknowns)?,
        };
        self.rows = Some(rows);
        let mut query = vec![("first", self.next.to_string())];
        match self.until {
            Until::Completed => query.push(("follow", "true".to_owned())),
            Until::Frame(end) => query.push(("count", (end - self.next).to_string())),
        }
        let request = self.client.request(Method::GET, &["v1", "sessions", &self.id, "cages"], &query).await?;
        let response = self.client.send(request.header(ACCEPT, MEDIA_TYPE)).await?;
        Ok((response, CageRecords::new(rows)))
    }

    /// The stream ended without an error; finds out whether more frames will follow.
    async fn ended(&mut self) -> Result<Step, Failure> {
        self.connection = None;
        if self.until != Until::Completed {
            return Ok(Step::End);
        }
        let session = self.client.session(&self.id).await?;
        match session.state {
            SessionState::Completed if u64::from(self.next) >= session.frames.solved => Ok(Step::End),
            SessionState::Completed => Err(self.client.broken(format!("the stream ended before frame {}", self.next))),
            SessionState::Failed => Err(ClientError::Failed(Box::new(reason(session))).into()),
            SessionState::Preparing | SessionState::Ready => {
                // Servers and proxies end long answers; that is no failure, but no reason to hurry either.
                tokio::time::sleep(RECONNECT).await;
                Ok(Step::Wait)
            }
        }
    }
}
