//! Webhooks that report completed and failed sessions and jobs, in the form of Standard Webhooks
//! (standardwebhooks.com).
//!
//! A message is a POST with the headers `webhook-id` (the same for every attempt), `webhook-timestamp` and `webhook-signature`, and a JSON
//! body. A response 2xx acknowledges it; otherwise it is sent again after increasing pauses, for about three days. Pending messages are
//! stored with what they are about and survive a restart: delivery is at least once.

mod deliver;
mod file;

pub use file::WebhooksError;

use crate::http_client::Client;
use crate::store::{Kind, Store, StoreError};
use cager_proto::job_messages::Job;
use cager_proto::messages::Session;
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
    /// A design, a recovery or a transfer was completed: its results are there.
    #[serde(rename = "job.completed")]
    JobCompleted,
    /// One failed.
    #[serde(rename = "job.failed")]
    JobFailed,
}

/// What a message is about.
#[derive(Clone, Debug)]
pub(crate) struct About {
    pub(crate) kind: Kind,
    pub(crate) id: String,
    pub(crate) tenant: String,
}

/// What a message tells of it.
#[derive(Serialize)]
#[serde(rename_all = "lowercase")]
pub(crate) enum Told {
    Session(Box<Session>),
    Job(Job),
}

/// A message about a session or job that has not been delivered to all receivers.
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

/// Reads a file of receivers, and nothing more.
///
/// # Errors
/// As [`Webhooks::open`], of the file.
pub(crate) fn check(file: &Path) -> Result<(), WebhooksError> {
    file::read(file).map(drop)
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

    /// The message about something of this tenant that ends now; `None` if no receiver wants it.
    pub(crate) fn message_for(&self, tenant: &str, event: Event) -> Option<PendingMessage> {
        let wanted = |hook: &&Arc<Hook>| hook.wants(tenant, event);
        let left: Vec<String> = self.hooks.iter().filter(wanted).map(|hook| hook.id.clone()).collect();
        let now = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).unwrap_or_default();
        let at_ms = now.as_millis().try_into().unwrap_or(u64::MAX);
        (!left.is_empty()).then_some(PendingMessage { event, at_ms, left })
    }

    /// Stores the message with what it is about, before that ends, so that a crash cannot lose it. Blocks.
    ///
    /// # Errors
    /// Storage errors.
    pub(crate) fn store_pending(&self, about: &About, event: Event) -> Result<Option<PendingMessage>, StoreError> {
        let due = self.message_for(&about.tenant, event);
        due.as_ref().map_or(Ok(()), |due| self.store.set_announcement(about.kind, &about.id, due))?;
        Ok(due)
    }

    /// The stored message, if some receiver has not acknowledged it. Blocks.
    pub(crate) fn pending(&self, about: &About) -> Option<PendingMessage> {
        if self.hooks.is_empty() {
            return None;
        }
        self.store.announcement(about.kind, &about.id).unwrap_or_else(|error| {
            tracing::warn!(id = about.id, %error, "a pending webhook message cannot be read");
            None
        })
    }

    /// Sends a message to its receivers, in the background and until what it is about is deleted.
    pub(crate) fn send(&self, about: &About, told: Told, deleted: &CancellationToken, due: PendingMessage) {
        let at = SystemTime::UNIX_EPOCH + Duration::from_millis(due.at_ms);
        let body = Body {
            kind: due.event,
            timestamp: humantime::format_rfc3339_millis(at).to_string(),
            data: Data { tenant: &about.tenant, told },
        };
        let body: bytes::Bytes = match serde_json::to_vec(&body) {
            Ok(body) => body.into(),
            Err(error) => {
                return tracing::error!(id = about.id, %error, "a webhook message cannot be serialised");
            }
        };
        let wanted = |hook: &&Arc<Hook>| due.left.contains(&hook.id) && hook.wants(&about.tenant, due.event);
        let wanted: Vec<Arc<Hook>> = self.hooks.iter().filter(wanted).cloned().collect();
        let left = Arc::new(Mutex::new(due));
        for hook in wanted {
            let message = Message {
                about: about.clone(),
                body: body.clone(),
                store: self.store.clone(),
                left: Arc::clone(&left),
            };
            let (client, stop, deleted) = (self.client.clone(), self.stop.clone(), deleted.clone());
            self.runtime.spawn(async move {
                // Deletion ends delivery.
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
    #[serde(flatten)]
    told: Told,
}
