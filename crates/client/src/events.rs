//! Progress of a session as it happens.

use crate::backoff::Backoff;
use crate::body::{BodyEvent, listen};
use crate::client::Client;
use crate::error::{ClientError, Failure};
use crate::sse::SseParser;
use cager_proto::messages::{Progress, SessionState};
use futures_util::stream::BoxStream;
use futures_util::{StreamExt, stream};
use reqwest::header::{ACCEPT, CONTENT_TYPE};
use reqwest::{Method, Response, StatusCode};
use serde::de::DeserializeOwned;
use std::collections::VecDeque;
use std::time::Duration;

/// Pause before the next connection where the stream does not ask for another one.
const RECONNECT: Duration = Duration::from_secs(1);

const EVENT_STREAM: &str = "text/event-stream";

/// Longest pause that a stream may ask for.
const MAX_RECONNECT: Duration = Duration::from_secs(60);

impl Client {
    /// Progress of a session as it happens, until it is complete or has failed; that is the last item. A broken connection is
    /// taken up again after the last event.
    ///
    /// An error, such as [`ClientError::Refused`] for a session that was deleted, ends the stream.
    pub fn events(&self, id: &str) -> BoxStream<'static, Result<Progress, ClientError>> {
        let is_last = |progress: &Progress| matches!(progress.state, SessionState::Completed | SessionState::Failed);
        Events::stream(self, EventsOf { resource: "sessions", id: id.to_owned() }, is_last)
    }
}

/// The object whose events are streamed.
pub(crate) struct EventsOf {
    pub(crate) resource: &'static str,
    pub(crate) id: String,
}

pub(crate) struct Events<T> {
    client: Client,
    place: EventsOf,
    /// Whether nothing follows.
    is_last: fn(&T) -> bool,
    backoff: Backoff,
    connection: Option<(Response, SseParser)>,
    last_id: Option<String>,
    pause: Duration,
    waiting: VecDeque<T>,
    done: bool,
}

impl<T: DeserializeOwned + Send + 'static> Events<T> {
    pub(crate) fn stream(
        client: &Client,
        place: EventsOf,
        is_last: fn(&T) -> bool,
    ) -> BoxStream<'static, Result<T, ClientError>> {
        let events = Self {
            client: client.clone(),
            place,
            is_last,
            backoff: client.backoff(),
            connection: None,
            last_id: None,
            pause: RECONNECT,
            waiting: VecDeque::new(),
            done: false,
        };
        stream::try_unfold(events, async |mut events| Ok(events.next().await?.map(|progress| (progress, events))))
            .boxed()
    }

    async fn next(&mut self) -> Result<Option<T>, ClientError> {
        loop {
            if let Some(progress) = self.waiting.pop_front() {
                self.backoff.progress();
                self.done = (self.is_last)(&progress);
                return Ok(Some(progress));
            }
            if self.done {
                return Ok(None);
            }
            if let Err(failure) = self.receive().await {
                self.connection = None;
                self.backoff.wait_after(failure).await?;
            }
        }
    }

    /// Waits for the next events, over a new connection where there is none.
    async fn receive(&mut self) -> Result<(), Failure> {
        let (response, parser) = match &mut self.connection {
            Some(connection) => connection,
            None => {
                let Some(response) = self.connect().await? else {
                    self.done = true;
                    return Ok(());
                };
                self.connection.insert((response, SseParser::default()))
            }
        };
        let BodyEvent::Piece(piece) = listen(&self.client, response).await? else {
            // Servers and proxies end long responses, and there may be no events for long. This is no failure, but there is no hurry to
            // reconnect either.
            self.connection = None;
            tokio::time::sleep(self.pause).await;
            return Ok(());
        };
        let events = parser.push(&piece).map_err(|_| Failure::protocol("an event has no end"))?;
        if let Some(id) = parser.last_id() {
            self.last_id = Some(id.to_owned());
        }
        self.pause = parser.retry().map_or(self.pause, |asked| asked.min(MAX_RECONNECT));
        for event in events {
            match serde_json::from_str(&event.data) {
                Ok(progress) => self.waiting.push_back(progress),
                Err(error) if matches!(event.event.as_str(), "" | "message" | "progress") => {
                    return Err(Failure::protocol(format!("an event is no progress: {error}")));
                }
                // Other types of events may come in later versions.
                Err(_) => {}
            }
        }
        Ok(())
    }

    async fn connect(&mut self) -> Result<Option<Response>, Failure> {
        let mut request =
            self.client.request(Method::GET, &["v1", self.place.resource, &self.place.id, "events"], &[]).await?;
        request = request.header(ACCEPT, EVENT_STREAM);
        if let Some(id) = &self.last_id {
            request = request.header("Last-Event-ID", id);
        }
        let response = self.client.send(request).await?;
        // 204 means that there will be no more events.
        if response.status() == StatusCode::NO_CONTENT {
            return Ok(None);
        }
        let kind = response.headers().get(CONTENT_TYPE).and_then(|kind| kind.to_str().ok()).unwrap_or_default();
        // A page ends without an event, however often it is asked for.
        if !kind.to_ascii_lowercase().starts_with(EVENT_STREAM) {
            return Err(Failure::protocol(format!("{kind:?} came where a stream of events was asked for")));
        }
        Ok(Some(response))
    }
}
