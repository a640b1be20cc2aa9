//! Full-duplex requests, whose response begins while the body is sent, and the fallback for proxies that do not support them.

use super::Upload;
use crate::client::Client;
use crate::error::Failure;
use std::pin::pin;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::Duration;

/// How long a full-duplex request may stall. The service begins its response within five seconds.
const LIVE_STALL_TIMEOUT: Duration = Duration::from_secs(10);

/// Progress of sending a request body.
#[derive(Default)]
pub(super) struct SendProgress {
    /// Whether the request is full-duplex.
    pub(super) live: bool,
    pub(super) bytes: AtomicU64,
    /// Whether the connection is waiting for the next frame to be read.
    pub(super) starved: AtomicBool,
}

/// Awaits `what` as long as bytes move. A full-duplex request that stalls although data is available is abandoned sooner, and full-duplex
/// requests are disabled.
pub(super) async fn with_idle_timeout<T>(
    client: &Client,
    sent: &SendProgress,
    what: impl Future<Output = T>,
) -> Result<T, Failure> {
    if !sent.live {
        return client.with_idle_timeout(&sent.bytes, what).await;
    }
    let limit = LIVE_STALL_TIMEOUT.min(client.options().idle_timeout / 2);
    let watched = async {
        let mut what = pin!(what);
        loop {
            let before = sent.bytes.load(Ordering::Relaxed);
            if let Ok(value) = tokio::time::timeout(limit, &mut what).await {
                return Ok(value);
            }
            if sent.bytes.load(Ordering::Relaxed) == before && !sent.starved.load(Ordering::Relaxed) {
                client.disable_live();
                let what = format!("no data moved for {:.0} s, as behind some proxies", limit.as_secs_f64());
                return Err(client.broken(format!("{what}; results come after each request from here on")));
            }
        }
    };
    client.with_idle_timeout(&sent.bytes, watched).await?
}

impl Upload<'_> {
    /// Classifies a failure of a full-duplex request: those that a proxy may have caused are retried without full duplex.
    pub(super) fn after_live_failure(&mut self, failure: Failure) -> Failure {
        match (failure.status(), failure) {
            // A proxy held the rest of the body back.
            (Some(408), failure) => {
                self.client.disable_live();
                failure
            }
            // Either a proxy lost bytes or the frame is invalid; sending it again without full duplex decides.
            (Some(400 | 422), Failure::Final(error)) => {
                self.live = false;
                Failure::transient(error)
            }
            (_, failure) => failure,
        }
    }
}
