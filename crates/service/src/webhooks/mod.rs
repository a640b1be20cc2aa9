//! Webhooks that report completed and failed sessions, in the form of Standard Webhooks (standardwebhooks.com).
//!
//! A message is a POST with the headers `webhook-id` (the same for every attempt), `webhook-timestamp` and `webhook-signature`, and a JSON
//! body. A response 2xx acknowledges it; otherwise it is sent again after increasing pauses, for about three days. Pending messages are
//! stored with the session and survive a restart: delivery is at least once.

mod deliver;
mod file;

pub use file::WebhooksError;

use crate::http_client::Client;
use crate::session::{Phase, Session};
use crate::store::{Store, StoreError};
use deliver::Message;
use file::Hook;
use serde::{Deserialize, Serialize};
use std::path::Path;
use std::sync::{Arc, Mutex};
use std::time::{Duration, SystemTime};
use tokio::runtime::Handle;
use tokio_util::sync::CancellationToken;

/// The events that are reported.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) enum Event {
    /// A session was completed: its container is there.
    #[serde(rename = "session.completed")]
    Completed,
    /// A session failed and takes no frames.
    #[serde(rename = "session.failed")]
    Failed,
}

/// A message about a session that has not been delivered to all receivers.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct PendingMessage {
    pub(crate) event: Event,
    /// When it happened, milliseconds since 1970.
    at_ms: u64,
    /// Identifiers of the receivers that have not acknowledged it.
    left: Vec<String>,
}

/// The configured receivers.
pub(crate) struct Webhooks {
    hooks: Vec<Arc<Hook>>,
    client: Client,
    store: Store,
    runtime: Handle,
    stop: CancellationToken,
}

impl Webhooks {
    /// Reads the file; without one there are no receivers. Call within a tokio runtime, which sends the messages until `stop`.
    ///
    /// # Errors
    /// A file that cannot be read, or an entry that is wrong, with its line; no authorities to check a receiver's certificate by.
    pub(crate) fn open(path: Option<&Path>, store: Store, stop: CancellationToken) -> Result<Arc<Self>, WebhooksError> {
        let hooks = path.map(file::read).transpose()?.unwrap_or_default();
        let client = Client::new().map_err(|why| WebhooksError::Client(why.to_string()))?;
        // What is missing is said at the start, not with the first message.
        for hook in &hooks {
            let usable = client.of(&hook.url);
            usable.map_err(|why| WebhooksError::Client(format!("the entry in line {}: {why}", hook.line)))?;
        }
        let hooks = hooks.into_iter().map(Arc::new).collect();
        Ok(Arc::new(Self { hooks, client, store, runtime: Handle::current(), stop }))
    }

    /// The message about a session that ends now; `None` if no receiver wants it.
    fn message_for(&self, session: &Session, event: Event) -> Option<PendingMessage> {
        let wanted = |hook: &&Arc<Hook>| hook.wants(&session.meta.tenant, event);
        let left: Vec<String> = self.hooks.iter().filter(wanted).map(|hook| hook.id.clone()).collect();
        let now = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).unwrap_or_default();
        let at_ms = now.as_millis().try_into().unwrap_or(u64::MAX);
        (!left.is_empty()).then_some(PendingMessage { event, at_ms, left })
    }

    /// Stores the message with the session, before the session ends, so that a crash cannot lose it. Blocks.
    ///
    /// # Errors
    /// Storage errors.
    pub(crate) fn store_pending(&self, session: &Session, event: Event) -> Result<Option<PendingMessage>, StoreError> {
        let due = self.message_for(session, event);
        due.as_ref().map_or(Ok(()), |due| self.store.set_announcement(&session.meta.id, due))?;
        Ok(due)
    }

    /// Sends the stored message of a session that has ended, if some receiver has not acknowledged it. Blocks.
    pub(crate) fn resend_undelivered(&self, session: &Session) {
        if self.hooks.is_empty() {
            return;
        }
        let due = self.store.announcement(&session.meta.id).unwrap_or_else(|error| {
            tracing::warn!(session = %session.meta.id, %error, "the pending webhook message of this session cannot be read");
            None
        });
        let ended = |due: &PendingMessage| match due.event {
            Event::Completed => matches!(session.status().phase, Phase::Completed(_)),
            Event::Failed => session.has_failed(),
        };
        if let Some(due) = due.filter(ended) {
            // The message contains frame counts; if frames cannot be read, that is logged.
            let _ = session.load();
            self.send(session, due);
        }
    }

    /// Reports a failed session whose message cannot be stored, because its files are damaged or the disk refuses writes.
    pub(crate) fn send_unrecorded(&self, session: &Session) {
        if let Some(due) = self.message_for(session, Event::Failed) {
            self.send(session, due);
        }
    }

    /// Sends a message to its receivers, in the background.
    pub(crate) fn send(&self, session: &Session, due: PendingMessage) {
        let at = SystemTime::UNIX_EPOCH + Duration::from_millis(due.at_ms);
        let body = Body {
            kind: due.event,
            timestamp: humantime::format_rfc3339_millis(at).to_string(),
            data: Data { tenant: &session.meta.tenant, session: session.view_with(0) },
        };
        let body: bytes::Bytes = match serde_json::to_vec(&body) {
            Ok(body) => body.into(),
            Err(error) => {
                return tracing::error!(session = %session.meta.id, %error, "a webhook message cannot be serialised");
            }
        };
        let told = |hook: &&Arc<Hook>| due.left.contains(&hook.id) && hook.wants(&session.meta.tenant, due.event);
        let wanted: Vec<Arc<Hook>> = self.hooks.iter().filter(told).cloned().collect();
        let left = Arc::new(Mutex::new(due));
        for hook in wanted {
            let message = Message {
                session: session.meta.id.clone(),
                body: body.clone(),
                store: self.store.clone(),
                left: Arc::clone(&left),
            };
            let (client, stop, deleted) = (self.client.clone(), self.stop.clone(), session.deleted().clone());
            self.runtime.spawn(async move {
                // Deletion of the session ends delivery.
                let delivered = deleted.run_until_cancelled(message.deliver(&hook, &client));
                stop.run_until_cancelled(delivered).await
            });
        }
    }
}

#[derive(Serialize)]
struct Body<'a> {
    #[serde(rename = "type")]
    kind: Event,
    timestamp: String,
    data: Data<'a>,
}

#[derive(Serialize)]
struct Data<'a> {
    tenant: &'a str,
    session: cager_proto::messages::Session,
}
