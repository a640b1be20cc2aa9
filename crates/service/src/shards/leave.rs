//! Giving shards up: what is asked goes on for a moment, what is asked from now on is for the next process. No request waits for longer than others wait for
//! that process.

use super::Shards;
use crate::sync::lock;
use std::sync::Arc;
use std::time::Duration;
use tokio::task::{JoinSet, spawn_blocking};
use tokio::time::timeout;

/// How long requests in progress may go on before streams are told to end.
const QUIET: Duration = Duration::from_secs(2);
/// How long what is told to end may take, before it is cut off.
const LAST: Duration = Duration::from_secs(2);
/// How long it is waited for shards that are just being taken, and for the database.
const OTHERS: Duration = Duration::from_secs(8);

impl Shards {
    /// Gives a shard up for another process.
    pub(super) async fn give_up(self: Arc<Self>, shard: u32) {
        self.close(shard).await;
        let members = Arc::clone(&self.members);
        if let Ok(Err(error)) = spawn_blocking(move || members.leaves(&[shard])).await {
            tracing::warn!(shard, %error, "the other processes do not know yet that it was given up");
        }
        let _ = self.look().await;
    }

    /// Gives up all shards, before the process ends.
    pub(crate) async fn leave(self: Arc<Self>) {
        let members = Arc::clone(&self.members);
        let told = spawn_blocking(move || members.ends());
        if !matches!(timeout(OTHERS, told).await, Ok(Ok(Ok(())))) {
            tracing::warn!("the other processes do not know yet that this one ends");
        }
        let taking = timeout(OTHERS, self.taking.lock()).await;
        let all: Vec<u32> = lock(&self.own).keys().copied().collect();
        let mut leaving: JoinSet<()> = JoinSet::new();
        for shard in all.clone() {
            let shards = Arc::clone(&self);
            leaving.spawn(async move { shards.close(shard).await });
        }
        while leaving.join_next().await.is_some() {}
        drop(taking);
        let members = Arc::clone(&self.members);
        let _ = timeout(OTHERS, spawn_blocking(move || members.leaves(&all))).await;
        let _ = timeout(OTHERS, self.look()).await;
        // Streams that pass through here go on elsewhere.
        self.ended.cancel();
    }

    /// Ends serving a shard, and lets others have it.
    async fn close(&self, shard: u32) {
        let (service, requests, stop, cut) = {
            let mut own = lock(&self.own);
            let Some(own) = own.get_mut(&shard) else { return };
            own.is_leaving = true;
            (Arc::clone(&own.service), own.requests.clone(), own.stop.clone(), own.cut.clone())
        };
        requests.close();
        let is_quiet = timeout(QUIET, requests.wait()).await.is_ok();
        // Streams end, and are taken up by their clients where the shard is then.
        stop.cancel();
        if !is_quiet && timeout(LAST, requests.wait()).await.is_err() {
            tracing::warn!(shard, open = requests.len(), "requests are cut off");
            cut.cancel();
        }
        let _ = spawn_blocking(move || service.release()).await;
        lock(&self.own).remove(&shard);
    }
}
