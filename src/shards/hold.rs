//! Which shards this process has: it takes those that nobody has, as many as are its share, and gives up what is more, so that a process that joins gets some
//! and one that ends loses none.

use super::forward::Forwarder;
use super::{Own, Shards};
use crate::cage_job::local_designer;
use crate::config::ServeConfig;
use crate::http::router;
use crate::resources::Resources;
use crate::service::{Service, StartError};
use crate::store::{LocalDisk, Shard, StoreError};
use crate::sync::lock;
use anyhow::{Context, Result, anyhow, bail};
use cager_store::{Members, Membership};
use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::sync::{Arc, Mutex};
use std::time::Duration;
use tokio::sync::watch;
use tokio::task::{JoinSet, spawn_blocking};
use tokio::time::Instant;
use tokio_util::sync::CancellationToken;
use tokio_util::task::TaskTracker;

/// How often it is looked at how things are.
const PAUSE: Duration = Duration::from_millis(200);
/// After the database was away, the others get so long to go on with what they had.
const AFTER_TROUBLE: Duration = Duration::from_secs(3);
/// How long a shard is left alone that could not be taken.
const AFTER_FAILURE: Duration = Duration::from_secs(5);
/// How long requests in progress may go on where a shard is given up, before streams are told to end.
const QUIET: Duration = Duration::from_secs(2);

/// Joins the processes that share the database; they reach this one at `address`. Takes shards from then on, until `stop`; returns when it has been seen
/// who has which, and the first one is taken where one is free.
///
/// # Errors
/// A database, a folder or a bucket that cannot be used.
pub(crate) async fn start(config: ServeConfig, address: String, stop: CancellationToken) -> Result<Arc<Shards>> {
    let resources = Resources::new(&config, local_designer())?;
    tokio::spawn(resources.access.clone().watch(stop.clone()));
    let url = config.catalog.clone().context("shards need --catalog")?;
    let is_tls = address.starts_with("https://");
    let (count, own_address) = (config.shards, address.clone());
    let members = spawn_blocking(move || Members::join(&url, count, &own_address)).await?;
    let members = Arc::new(members.map_err(|error| anyhow!("{error}"))?);
    tracing::info!(shards = members.shards(), number = members.number(), address, "joined");
    let idle = Duration::from_secs(config.idle_timeout_s);
    let shards = Arc::new(Shards {
        config,
        resources,
        members,
        own: Mutex::default(),
        seen: watch::Sender::default(),
        trouble: Mutex::default(),
        tenants: Mutex::new(HashMap::new()),
        forwarder: Forwarder::new(is_tls, idle)?,
        stop,
    });
    let mut holding = Holding { shards: Arc::clone(&shards), failed: BTreeMap::new() };
    shards.look().await?;
    holding.take_share().await?;
    tokio::spawn(Arc::clone(&shards).watch());
    tokio::spawn(holding.keep());
    Ok(shards)
}

/// What takes shards and gives them up.
struct Holding {
    shards: Arc<Shards>,
    /// When what could not be taken is tried again.
    failed: BTreeMap<u32, Instant>,
}

impl Holding {
    async fn keep(mut self) {
        loop {
            tokio::time::sleep(PAUSE).await;
            self.drop_lost();
            let is_quiet = lock(&self.shards.trouble).is_some_and(|then| then.elapsed() < AFTER_TROUBLE);
            if self.shards.stop.is_cancelled() || is_quiet {
                continue;
            }
            let changed = match self.surplus() {
                Some(shard) => {
                    tracing::info!(shard, "given up, for a process that has fewer");
                    Arc::clone(&self.shards).give_up(shard).await
                }
                None => self.take_share().await,
            };
            if let Err(error) = changed {
                tracing::error!(error = format!("{error:#}"), "shards stay as they are");
            }
        }
    }

    /// Takes free shards, until this process has its share.
    ///
    /// # Errors
    /// Why one of them cannot be served; the others are.
    async fn take_share(&mut self) -> Result<()> {
        let mut failed = Ok(());
        loop {
            let wanted = self.wanted();
            if wanted.is_empty() {
                return failed;
            }
            let mut taking = JoinSet::new();
            for shard in wanted {
                let shards = Arc::clone(&self.shards);
                taking.spawn(async move { (shard, shards.take(shard).await) });
            }
            while let Some(taken) = taking.join_next().await {
                let (shard, Err(error)) = taken? else { continue };
                self.failed.insert(shard, Instant::now() + AFTER_FAILURE);
                // Another process may have been faster.
                if !matches!(error.downcast_ref(), Some(StartError::Store(StoreError::InUse { .. }))) {
                    failed = Err(error.context(format!("shard {shard} cannot be served")));
                }
            }
            self.shards.look().await?;
        }
    }

    /// The free shards that this process takes next. Each process begins elsewhere, so that they do not want the same.
    fn wanted(&mut self) -> Vec<u32> {
        let now = Instant::now();
        self.failed.retain(|_, until| *until > now);
        let (seen, own) = (self.shards.seen.borrow(), lock(&self.shards.own));
        let processes = seen.staying().count().max(1);
        let share = (self.shards.members.shards() as usize).div_ceil(processes);
        let rank = seen.staying().position(|number| number == self.shards.members.number()).unwrap_or_default();
        let is_open = |shard: &&u32| !own.contains_key(shard) && !self.failed.contains_key(shard);
        let mut free: Vec<(usize, u32)> = seen.free.iter().filter(is_open).copied().enumerate().collect();
        free.sort_by_key(|(at, _)| (at + processes - rank) % processes);
        free.into_iter().map(|(_, shard)| shard).take(share.saturating_sub(own.len())).collect()
    }

    /// Forgets shards that another process has taken over.
    fn drop_lost(&self) {
        let mut own = lock(&self.shards.own);
        own.retain(|shard, own| {
            let is_kept = own.is_leaving || !own.stop.is_cancelled();
            if !is_kept {
                tracing::warn!(shard, "another process has taken the shard over");
            }
            is_kept
        });
    }

    /// A shard to give up, for a process that has at least two fewer. One process at a time gives up, the last of those that have most.
    fn surplus(&self) -> Option<u32> {
        let seen = self.shards.seen.borrow();
        if !seen.free.is_empty() {
            return None;
        }
        let me = self.shards.members.number();
        most_and_least(&seen).filter(|(most, _)| *most == me)?;
        lock(&self.shards.own).keys().next_back().copied()
    }
}

/// Of the processes the one that has most shards, and the one that has least, where these have two more and fewer.
fn most_and_least(seen: &Membership) -> Option<(i32, i32)> {
    let mut counts: BTreeMap<i32, usize> = seen.staying().map(|number| (number, 0)).collect();
    for holder in seen.holders.values() {
        counts.entry(*holder).and_modify(|count| *count += 1);
    }
    let most = counts.iter().max_by_key(|(number, count)| (**count, **number))?;
    let least = counts.iter().min_by_key(|(number, count)| (**count, **number))?;
    (*most.1 > least.1 + 1).then_some((*most.0, *least.0))
}

impl Shards {
    /// Looks at how things are, again and again, until the process ends.
    async fn watch(self: Arc<Self>) {
        loop {
            tokio::time::sleep(PAUSE).await;
            if let Err(error) = self.look().await
                && lock(&self.trouble).replace(Instant::now()).is_none_or(|then| then.elapsed() > AFTER_TROUBLE)
            {
                tracing::error!(%error, "it is not seen who has which shard");
            }
        }
    }

    /// Looks at how things are.
    async fn look(&self) -> Result<()> {
        let members = Arc::clone(&self.members);
        let now = spawn_blocking(move || members.look()).await?.map_err(|error| anyhow!("{error}"))?;
        self.seen.send_if_modified(|seen| {
            let is_new = *seen != now;
            *seen = now;
            is_new
        });
        Ok(())
    }

    /// Begins to serve a shard.
    async fn take(self: Arc<Self>, shard: u32) -> Result<()> {
        // Not stopped with the process, but given up by it.
        let stop = CancellationToken::new();
        let part = Shard { number: shard, of: self.members.shards() };
        let (config, resources) = (self.config.of_shard(part), Arc::clone(&self.resources));
        let (own_stop, members) = (stop.clone(), Arc::clone(&self.members));
        let service = spawn_blocking(move || {
            let service = Service::of_shard(resources, config, Arc::new(LocalDisk), part, own_stop)?;
            let tenants: BTreeSet<String> = service.usage().into_iter().map(|(tenant, ..)| tenant).collect();
            let tenants: Vec<String> = tenants.into_iter().collect();
            if let Err(error) = members.serves(shard, &tenants) {
                service.stopping().cancel();
                service.release();
                bail!("{error}");
            }
            Ok(service)
        });
        let service = service.await??;
        let router = router(Arc::clone(&service));
        let own = Own { service, router, stop, requests: TaskTracker::new(), is_leaving: false };
        lock(&self.own).insert(shard, own);
        tracing::info!(shard, "served here");
        Ok(())
    }

    /// Ends serving a shard: what is asked goes on for a while, what is asked from now on is for the next process.
    async fn give_up(self: Arc<Self>, shard: u32) -> Result<()> {
        let (service, requests, stop) = {
            let mut own = lock(&self.own);
            let Some(own) = own.get_mut(&shard) else { return Ok(()) };
            own.is_leaving = true;
            (Arc::clone(&own.service), own.requests.clone(), own.stop.clone())
        };
        requests.close();
        let _ = tokio::time::timeout(QUIET, requests.wait()).await;
        // Streams end, and are taken up by their clients where the shard is then.
        stop.cancel();
        let drain = Duration::from_secs(self.config.drain_timeout_s);
        if tokio::time::timeout(drain, requests.wait()).await.is_err() {
            tracing::warn!(shard, open = requests.len(), "requests are cut off");
        }
        let members = Arc::clone(&self.members);
        let left = spawn_blocking(move || {
            let left = members.leaves(shard).map_err(|error| anyhow!("{error}"));
            service.release();
            left
        });
        let left = left.await?;
        lock(&self.own).remove(&shard);
        left
    }

    /// Gives up all shards, before the process ends.
    pub(crate) async fn leave(self: Arc<Self>) {
        let members = Arc::clone(&self.members);
        if let Ok(Err(error)) = spawn_blocking(move || members.ends()).await {
            tracing::warn!(%error, "the other processes do not know yet that this one ends");
        }
        let all: Vec<u32> = lock(&self.own).keys().copied().collect();
        let mut leaving = JoinSet::new();
        all.into_iter().for_each(|shard| drop(leaving.spawn(Arc::clone(&self).give_up(shard))));
        while let Some(left) = leaving.join_next().await {
            if let Ok(Err(error)) | Err(error) = left.map_err(anyhow::Error::from) {
                tracing::warn!(%error, "a shard was not given up");
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn seen(counts: &[(i32, usize)]) -> Membership {
        let mut seen = Membership::default();
        for &(number, count) in counts {
            seen.processes.insert(number, String::new());
            for _ in 0..count {
                seen.holders.insert(seen.holders.len() as u32, number);
            }
        }
        seen
    }

    #[test]
    fn who_has_two_more_than_another_gives_one_up() {
        assert_eq!(most_and_least(&seen(&[(5, 4), (7, 4)])), None);
        assert_eq!(most_and_least(&seen(&[(5, 3), (7, 3), (2, 2)])), None);
        assert_eq!(most_and_least(&seen(&[(5, 8), (7, 0)])), Some((5, 7)));
        assert_eq!(most_and_least(&seen(&[(5, 4), (7, 4), (2, 0)])), Some((7, 2)), "one at a time");
    }
}
