//! Delivering a message, with retries.

use super::file::Hook;
use super::{About, Event, PendingMessage};
use crate::http_client::Client;
use crate::store::Store;
use crate::sync::lock;
use base64::Engine as _;
use base64::prelude::BASE64_STANDARD;
use bytes::Bytes;
use http::StatusCode;
use reqwest::header;
use ring::hmac;
use std::sync::atomic::Ordering::Relaxed;
use std::sync::{Arc, Mutex, MutexGuard};
use std::time::{Duration, SystemTime};

const MINUTE: u64 = 60;
const HOUR: u64 = 60 * MINUTE;
/// Pauses after failed attempts, in seconds; after the last one the message is given up.
const PAUSES: [u64; 10] = [2, 15, MINUTE, 5 * MINUTE, 30 * MINUTE, 2 * HOUR, 6 * HOUR, 12 * HOUR, 24 * HOUR, 24 * HOUR];

/// A message to one receiver.
pub(super) struct Message {
    pub(super) about: About,
    pub(super) body: Bytes,
    pub(super) store: Store,
    /// The receivers that have not acknowledged it, shared by all messages about the same.
    pub(super) left: Arc<Mutex<PendingMessage>>,
}

impl Message {
    /// Sends the message until it is acknowledged or given up.
    pub(super) async fn deliver(self, hook: &Hook, client: &Client) {
        let id = self.id();
        let mut pauses = PAUSES.iter();
        let result = loop {
            if hook.gone.load(Relaxed) {
                break "gone";
            }
            let why = match self.send(&id, hook, client).await {
                Ok(status) if status.is_success() => break "delivered",
                Ok(StatusCode::GONE) => {
                    hook.gone.store(true, Relaxed);
                    break "gone";
                }
                Ok(status) => format!("it answered {status}"),
                Err(why) => why,
            };
            metrics::counter!("cager_webhooks_total", "result" => "failed_attempt").increment(1);
            let line = hook.line;
            let Some(pause) = pauses.next() else {
                tracing::error!(line, id, why, "a webhook message is given up");
                break "given_up";
            };
            tracing::warn!(line, id, why, again_in_s = pause, "a webhook message was not delivered");
            tokio::time::sleep(Duration::from_secs(*pause)).await;
        };
        let told = hook.id.clone();
        let noted = tokio::task::spawn_blocking(move || {
            let mut due = self.due();
            due.left.retain(|hook| *hook != told);
            self.store.set_announcement(self.about.kind, &self.about.id, &*due)
        });
        // If this is not stored, the message is sent again after a restart with the same id. What is noted of
        // something deleted is gone.
        if let Ok(Err(error)) = noted.await {
            tracing::debug!(%error, "the delivery of a webhook message could not be stored");
        }
        metrics::counter!("cager_webhooks_total", "result" => result).increment(1);
    }

    fn due(&self) -> MutexGuard<'_, PendingMessage> {
        lock(&self.left)
    }

    /// The same for every attempt.
    fn id(&self) -> String {
        let what = match self.due().event {
            Event::Completed | Event::JobCompleted => "completed",
            Event::Failed | Event::JobFailed => "failed",
        };
        format!("{}.{what}", self.about.id)
    }

    async fn send(&self, id: &str, hook: &Hook, client: &Client) -> Result<StatusCode, String> {
        let _one_of_few = hook.places.acquire().await;
        let seconds = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).unwrap_or_default().as_secs();
        let request = client
            .post(&hook.url)
            .map_err(|why| why.to_string())?
            .header(header::CONTENT_TYPE, "application/json")
            .header("webhook-id", id)
            .header("webhook-timestamp", seconds)
            .header("webhook-signature", signature(&hook.key, id, seconds, &self.body))
            .body(self.body.clone());
        let answer = request.send().await;
        answer.map(|answer| answer.status()).map_err(|error| error.without_url().to_string())
    }
}

/// `v1,` and the base64 HMAC-SHA-256 of `id.timestamp.body`.
fn signature(key: &hmac::Key, id: &str, seconds: u64, body: &[u8]) -> String {
    let mut context = hmac::Context::with_key(key);
    context.update(format!("{id}.{seconds}.").as_bytes());
    context.update(body);
    format!("v1,{}", BASE64_STANDARD.encode(context.sign()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn signatures_are_those_of_the_standard() {
        // Computed with Python's hmac and base64 modules.
        let secret = BASE64_STANDARD.decode("MfKQ9r8GKYqrTwjUPD8ILPZIo2LaLaSw").unwrap();
        let key = hmac::Key::new(hmac::HMAC_SHA256, &secret);
        let signed = signature(&key, "msg_p5jXN8AQM9LWM0D4loKWxJek", 1_614_265_330, br#"{"test": 2432232314}"#);
        assert_eq!(signed, "v1,g0hM9SsE+OTPJTGt/tmIKtSyZlE3uFJELVlNIOLJ1OE=");
    }
}
