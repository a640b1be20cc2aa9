//! Tells others that a session was completed or failed, in the form of Standard Webhooks (standardwebhooks.com).
//!
//! A message is a POST with the headers `webhook-id` (the same whenever it is sent again), `webhook-timestamp` and
//! `webhook-signature`, and a JSON body. It counts as delivered with an answer of 2xx; otherwise it is sent again after growing pauses, for
//! some three days. What is not delivered yet is kept with the session, so that it survives a restart: a message arrives at least once.

mod deliver;
mod file;

pub use file::WebhooksError;

use crate::outgoing::Client;
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

/// What is told.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) enum Event {
    /// A session was completed: its container is there.
    #[serde(rename = "session.completed")]
    Completed,
    /// A session failed and takes no frames.
    #[serde(rename = "session.failed")]
    Failed,
}

/// What has to be told of a session, and to whom.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Due {
    pub(crate) event: Event,
    /// When it happened, milliseconds since 1970.
    at_ms: u64,
    /// Hooks that were not told yet, by what stands for their addresses.
    left: Vec<String>,
}

/// Name of the note of a session that holds what is [`Due`].
const NOTE: &str = "announce";

/// Who is told.
pub(crate) struct Webhooks {
    hooks: Vec<Arc<Hook>>,
    client: Client,
    store: Store,
    runtime: Handle,
    stop: CancellationToken,
}

impl Webhooks {
    /// Reads the file; without one nobody is told. Within a tokio runtime, on which messages are sent until `stop`.
    ///
    /// # Errors
    /// A file that cannot be read, or an entry that is wrong, with its line.
    pub(crate) fn open(path: Option<&Path>, store: Store, stop: CancellationToken) -> Result<Arc<Self>, WebhooksError> {
        let hooks = path.map(file::read).transpose()?.unwrap_or_default();
        let client = Client::new().map_err(WebhooksError::Client)?;
        let hooks = hooks.into_iter().map(Arc::new).collect();
        Ok(Arc::new(Self { hooks, client, store, runtime: Handle::current(), stop }))
    }

    /// What there is to tell of a session that ends now, if somebody wants to know.
    fn due(&self, session: &Session, event: Event) -> Option<Due> {
        let wanted = |hook: &&Arc<Hook>| hook.wants(&session.meta.tenant, event);
        let left: Vec<String> = self.hooks.iter().filter(wanted).map(|hook| hook.id.clone()).collect();
        let now = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).unwrap_or_default();
        let at_ms = now.as_millis().try_into().unwrap_or(u64::MAX);
        (!left.is_empty()).then_some(Due { event, at_ms, left })
    }

    /// Keeps with a session what there is to tell of it; called before it ends, so that no crash comes between. Blocks.
    ///
    /// # Errors
    /// What the store says.
    pub(crate) fn keep(&self, session: &Session, event: Event) -> Result<Option<Due>, StoreError> {
        let due = self.due(session, event);
        due.as_ref().map_or(Ok(()), |due| self.store.put_note(&session.meta.id, NOTE, due))?;
        Ok(due)
    }

    /// Tells what was kept with a session and did not arrive, if it has ended so. Blocks.
    pub(crate) fn tell_left(&self, session: &Session) {
        if self.hooks.is_empty() {
            return;
        }
        let due = self.store.note(&session.meta.id, NOTE).unwrap_or_else(|error| {
            tracing::warn!(session = %session.meta.id, %error, "who has to be told of this session cannot be read");
            None
        });
        let ended = |due: &Due| match due.event {
            Event::Completed => matches!(session.status().phase, Phase::Completed(_)),
            Event::Failed => session.has_failed(),
        };
        if let Some(due) = due.filter(ended) {
            // Its frames are told of as well; where they cannot be read, the log says why.
            let _ = session.load();
            self.tell(session, due);
        }
    }

    /// Tells that a session failed with whose files nothing can be kept, because they are damaged or the disk takes nothing.
    pub(crate) fn tell_unkept(&self, session: &Session) {
        if let Some(due) = self.due(session, Event::Failed) {
            self.tell(session, due);
        }
    }

    /// Tells of a session that has ended. Goes on in the background.
    pub(crate) fn tell(&self, session: &Session, due: Due) {
        let at = SystemTime::UNIX_EPOCH + Duration::from_millis(due.at_ms);
        let body = Body {
            kind: due.event,
            timestamp: humantime::format_rfc3339_millis(at).to_string(),
            data: Data { tenant: &session.meta.tenant, session: session.view_with(0) },
        };
        let body: bytes::Bytes = match serde_json::to_vec(&body) {
            Ok(body) => body.into(),
            Err(error) => {
                return tracing::error!(session = %session.meta.id, %error, "a webhook's message cannot be written");
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
                // Of a session that was deleted nothing more is told.
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
