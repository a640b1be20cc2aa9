//! Requests whose answers begin while they are sent, and proxies that cannot carry them.

use super::Upload;
use crate::client::Client;
use crate::error::Failure;
use std::pin::pin;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::Duration;

/// How long a live request may stand still. The service begins its answer within five seconds.
const STANDSTILL: Duration = Duration::from_secs(10);

/// How far a request's body has come.
#[derive(Default)]
pub(super) struct Sent {
    /// Whether results are asked for while it is sent.
    pub(super) live: bool,
    pub(super) bytes: AtomicU64,
    /// Whether the next frame is still being read, so that nothing can move.
    pub(super) starved: AtomicBool,
}

/// Waits for something of a request as long as bytes move. A live one that stands still although there is something to send or to be
/// answered is given up sooner, and the client goes on without.
pub(super) async fn while_moving<T>(client: &Client, sent: &Sent, what: impl Future<Output = T>) -> Result<T, Failure> {
    if !sent.live {
        return client.while_moving(&sent.bytes, what).await;
    }
    let limit = STANDSTILL.min(client.options().idle_timeout / 2);
    let watched = async {
        let mut what = pin!(what);
        loop {
            let before = sent.bytes.load(Ordering::Relaxed);
            if let Ok(value) = tokio::time::timeout(limit, &mut what).await {
                return Ok(value);
            }
            if sent.bytes.load(Ordering::Relaxed) == before && !sent.starved.load(Ordering::Relaxed) {
                client.give_up_live();
                return Err(client
                    .broken(format!("nothing moved for {limit:.0?}; results come after each request from here on")));
            }
        }
    };
    client.while_moving(&sent.bytes, watched).await?
}

impl Upload<'_> {
    /// What a failure of a live request means. One that something in between may have caused is tried again without.
    pub(super) fn without_live(&mut self, failure: Failure) -> Failure {
        match (failure.status(), failure) {
            // The service waited for the rest of the body, which was kept back.
            (Some(408), failure) => {
                self.client.give_up_live();
                failure
            }
            // Bytes were lost, or the frame is bad: the same frames without live tell.
            (Some(400 | 422), Failure::Final(error)) => {
                self.live = false;
                Failure::transient(error)
            }
            (_, failure) => failure,
        }
    }
}
