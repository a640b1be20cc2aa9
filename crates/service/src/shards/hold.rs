//! Which shards this process has: it looks who has which, takes its share of those that nobody has, and gives up what is more.

use super::forward::Forwarder;
use super::share::{gives_up, wanted};
use super::{Own, Shards};
use crate::cage_job::local_designer;
use crate::config::ServeConfig;
use crate::http::router;
use crate::resources::Resources;
use crate::service::{Service, StartError};
use crate::store::{LocalDisk, Shard, StoreError};
use crate::sync::lock;
use anyhow::{Context, Result, anyhow, bail};
use cager_store::Members;
use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::sync::{Arc, Mutex};
use std::time::Duration;
use tokio::sync::watch;
use tokio::task::{JoinSet, spawn_blocking};
use tokio::time::{Instant, sleep};
use tokio_util::sync::CancellationToken;
use tokio_util::task::TaskTracker;

/// How often it is looked at how things are.
const PAUSE: Duration = Duration::from_millis(200);
/// After the database was away, and where a process that lives has lost the lock of its shard, that one gets so long to go on.
const TAKEOVER_WAIT: Duration = Duration::from_secs(3);
/// How long a shard is left alone that could not be taken, or was given up.
const AFTER_FAILURE: Duration = Duration::from_secs(5);
/// Nothing is given up while a shard is served by nobody, as where it moves, unless that takes longer.
const MOVING: Duration = Duration::from_secs(10);

/// Joins the processes that share the database; they reach this one at `address`. Takes shards from then on, until `stop`; returns when its share is taken.
///
/// # Errors
/// A database, a folder or a bucket that cannot be used.
pub(crate) async fn start(config: ServeConfig, address: String, stop: CancellationToken) -> Result<Arc<Shards>> {
    let resources = Resources::new(&config, local_designer())?;
    tokio::spawn(resources.access.clone().watch(stop.clone()));
    let url = config.catalog.clone().context("shards need --catalog")?;
    let (count, own_address) = (config.shards, address.clone());
    let members = spawn_blocking(move || Members::join(&url, count, &own_address)).await?;
    let members = Arc::new(members.map_err(|error| anyhow!("{error}"))?);
    tracing::info!(shards = members.shards(), number = members.number(), address, "joined");
    let forwarder = Forwarder::new(address.starts_with("https://"), Duration::from_secs(config.idle_timeout_s))?;
    let shards = Arc::new(Shards {
        config,
        resources,
        members,
        own: Mutex::default(),
        seen: watch::Sender::default(),
        seen_at: Mutex::new(Instant::now()),
        trouble: Mutex::default(),
        tenants: Mutex::new(HashMap::new()),
        forwarder,
        taking: tokio::sync::Mutex::default(),
        ended: CancellationToken::new(),
        stop,
    });
    let mut holding = Holding { shards: Arc::clone(&shards), failed: BTreeMap::new(), free_since: BTreeMap::new() };
    shards.look().await?;
    shards.alone_at(&address).await?;
    if let Err(error) = holding.take_share().await {
        if lock(&shards.own).is_empty() && shards.seen.borrow().holders.is_empty() {
            return Err(error);
        }
        tracing::error!(error = format!("{error:#}"), "it is tried again");
    }
    tokio::spawn(Arc::clone(&shards).watch());
    tokio::spawn(holding.keep());
    Ok(shards)
}

/// What takes shards and gives them up.
struct Holding {
    shards: Arc<Shards>,
    /// When what could not be taken is tried again.
    failed: BTreeMap<u32, Instant>,
    /// Since when nobody has a shard for himself, or nobody serves it.
    free_since: BTreeMap<u32, Instant>,
}

impl Holding {
    async fn keep(mut self) {
        while self.shards.stop.run_until_cancelled(sleep(PAUSE)).await.is_some() {
            self.drop_lost();
            if lock(&self.shards.trouble).is_some_and(|then| then.elapsed() < TAKEOVER_WAIT) {
                continue;
            }
            self.note_free();
            if let Some(shard) = self.surplus() {
                tracing::info!(shard, "given up, for a process that has fewer");
                self.failed.insert(shard, Instant::now() + AFTER_FAILURE);
                tokio::spawn(Arc::clone(&self.shards).give_up(shard));
            } else if let Err(error) = self.take_share().await {
                tracing::error!(error = format!("{error:#}"), "it is tried again");
            }
        }
    }

    /// Takes free shards, until this process has its share.
    ///
    /// # Errors
    /// Why one of them cannot be served; the others are.
    async fn take_share(&mut self) -> Result<()> {
        let shards = Arc::clone(&self.shards);
        let _one = shards.taking.lock().await;
        let mut failed = Ok(());
        loop {
            let open = self.open();
            let own = lock(&shards.own).len();
            let wanted = wanted(&shards.seen.borrow(), shards.members.number(), own, shards.members.shards(), &open);
            if wanted.is_empty() || shards.stop.is_cancelled() {
                return failed;
            }
            let mut taking = JoinSet::new();
            for shard in wanted {
                let shards = Arc::clone(&shards);
                taking.spawn(async move { (shard, shards.take(shard).await) });
            }
            while let Some(taken) = taking.join_next().await {
                let (shard, Err(error)) = taken? else { continue };
                // Another process may have been faster.
                let is_passing = matches!(error.downcast_ref(), Some(StartError::Store(StoreError::InUse { .. })));
                self.failed.insert(shard, Instant::now() + if is_passing { PAUSE } else { AFTER_FAILURE });
                if !is_passing {
                    failed = Err(error.context(format!("shard {shard} cannot be served")));
                }
            }
            shards.look().await?;
        }
    }

    /// Free shards that may be taken: not those that just failed, nor those of a process that lives and may have its lock again in a moment.
    fn open(&mut self) -> Vec<u32> {
        let now = Instant::now();
        self.failed.retain(|_, until| *until > now);
        let (seen, own) = (self.shards.seen.borrow(), lock(&self.shards.own));
        let is_left = |shard: &u32| self.free_since.get(shard).is_some_and(|since| since.elapsed() > TAKEOVER_WAIT);
        let is_open = |shard: &&u32| {
            let is_nobodys = !seen.holders.contains_key(shard) || is_left(shard);
            is_nobodys && !own.contains_key(shard) && !self.failed.contains_key(shard)
        };
        seen.free.iter().filter(is_open).copied().collect()
    }

    fn note_free(&mut self) {
        let seen = self.shards.seen.borrow();
        let is_free = |shard: &u32| seen.free.contains(shard) || !seen.holders.contains_key(shard);
        self.free_since.retain(|shard, _| is_free(shard));
        for shard in (0..self.shards.members.shards()).filter(is_free) {
            self.free_since.entry(shard).or_insert_with(Instant::now);
        }
    }

    /// A shard to give up. One is moved at a time.
    fn surplus(&self) -> Option<u32> {
        let (seen, own) = (self.shards.seen.borrow(), lock(&self.shards.own));
        let is_settled = self.free_since.values().all(|since| since.elapsed() > MOVING);
        let is_moving = !is_settled || own.values().any(|own| own.is_leaving);
        (!is_moving && gives_up(&seen, self.shards.members.number())).then(|| own.keys().next_back().copied())?
    }

    /// Forgets shards that another process has taken over.
    fn drop_lost(&self) {
        lock(&self.shards.own).retain(|shard, own| {
            let is_kept = own.is_leaving || !own.stop.is_cancelled();
            if !is_kept {
                own.cut.cancel();
                tracing::warn!(shard, "another process has taken the shard over");
            }
            is_kept
        });
    }
}

impl Shards {
    /// Looks at how things are, again and again, until the process ends.
    async fn watch(self: Arc<Self>) {
        loop {
            sleep(PAUSE).await;
            if let Err(error) = self.look().await
                && lock(&self.trouble).replace(Instant::now()).is_none_or(|then| then.elapsed() > TAKEOVER_WAIT)
            {
                tracing::error!(%error, "it is not seen who has which shard");
            }
        }
    }

    /// Looks at how things are.
    pub(super) async fn look(&self) -> Result<()> {
        let members = Arc::clone(&self.members);
        let now = spawn_blocking(move || members.look()).await?.map_err(|error| anyhow!("{error}"))?;
        *lock(&self.seen_at) = Instant::now();
        self.seen.send_if_modified(|seen| {
            let is_new = *seen != now;
            *seen = now;
            is_new
        });
        Ok(())
    }

    /// Sees that no other process that lives is reached at the same address. One that has just been killed may seem to live.
    async fn alone_at(&self, address: &str) -> Result<()> {
        let is_taken = || {
            let seen = self.seen.borrow();
            seen.processes.iter().any(|(number, known)| *number != self.members.number() && known == address)
        };
        let began = Instant::now();
        while is_taken() {
            if began.elapsed() > AFTER_FAILURE {
                bail!("another process is reached at {address}: give each its own --advertise");
            }
            sleep(PAUSE).await;
            self.look().await?;
        }
        Ok(())
    }

    /// Begins to serve a shard.
    async fn take(self: Arc<Self>, shard: u32) -> Result<()> {
        // Not stopped with the process, but given up by it.
        let stop = CancellationToken::new();
        let part = Shard { number: shard, of: self.members.shards() };
        let (config, resources) = (self.config.of_shard(part), Arc::clone(&self.resources));
        let (own_stop, members, ending) = (stop.clone(), Arc::clone(&self.members), self.stop.clone());
        let service = spawn_blocking(move || {
            let service = Service::of_shard(resources, config, Arc::new(LocalDisk), part, own_stop)?;
            let tenants: BTreeSet<String> = service.usage().into_iter().map(|(tenant, ..)| tenant).collect();
            let tenants: Vec<String> = tenants.into_iter().collect();
            let served = match ending.is_cancelled() {
                true => Err("the process ends".to_owned()),
                false => members.serves(shard, &tenants).map_err(|error| error.to_string()),
            };
            if let Err(why) = served {
                service.stopping().cancel();
                service.release();
                bail!(why);
            }
            Ok(service)
        });
        let service = service.await??;
        let router = router(Arc::clone(&service));
        let cut = CancellationToken::new();
        let own = Own { service, router, stop, cut, requests: TaskTracker::new(), is_leaving: false };
        lock(&self.own).insert(shard, own);
        tracing::info!(shard, "served here");
        Ok(())
    }
}
