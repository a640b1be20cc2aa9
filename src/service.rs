//! The service: store, engine, caches, registries and background tasks; startup and shutdown.

use crate::admission::{Budget, Held};
use crate::audit::Audit;
use crate::auth::{Access, Tenant};
use crate::cage_job::{CageDesign, DesignPool, Designer, local_designer};
use crate::config::ServeConfig;
use crate::engine::{Engine, threads};
use crate::jobs::Jobs;
use crate::preparation::{CageMaker, Solvers};
use crate::problem::{self, ApiError};
use crate::recovery::Recovery;
use crate::session::commit::Committer;
use crate::session::registry::Registry;
use crate::shape_spaces::ShapeSpaces;
use crate::store::{ContentKey, Disk, Shared, Store, StoreError};
use crate::tasks::blocking;
use crate::transfers::Transfer;
use crate::webhooks::{Webhooks, WebhooksError};
use std::collections::BTreeSet;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;
use tokio_util::sync::CancellationToken;

/// Threads that store frames; they mostly wait for the disk.
const COMMIT_THREADS: usize = 4;
/// Recoveries that keep what they know while they wait, beside one for each that may work.
const RECOVERIES_KEPT: u64 = 4;
/// New sessions and cage jobs whose files are parsed at a time.
const MAX_CONCURRENT_PARSING: u64 = 2;
/// Sessions completed at a time: each reads all its frames and keeps a processor busy.
const MAX_CONCURRENT_COMPLETIONS: u64 = 2;

/// Groups of frames coded or decoded at a time, at most: each takes up to half a gigabyte.
const MAX_CONCURRENT_CODINGS: usize = 4;

/// Memory for the coordinates of all who read completed transfers, in bytes, beyond which they wait for each other; those of one reader alone may be larger.
const DECODING_BYTES: u64 = 512 << 20;

/// Step in which the memory permit of an upload grows, in bytes; small, so that hundreds of small models fit.
const UPLOAD_PIECE: u64 = 64 << 10;

/// How long the result of a disk probe is valid.
const PROBE_VALIDITY: std::time::Duration = std::time::Duration::from_secs(1);
/// Sessions written as files of other programs at a time.
const MAX_CONCURRENT_EXPORTS: u64 = 2;
/// How often it is looked whether another process has the database.
const TAKEN_OVER_CHECK: std::time::Duration = std::time::Duration::from_millis(200);

/// State shared by all request handlers.
pub struct Service {
    pub(crate) config: ServeConfig,
    pub(crate) access: Access,
    pub(crate) audit: Audit,
    pub(crate) store: Store,
    pub(crate) engine: Engine,
    pub(crate) solvers: Arc<Solvers>,
    pub(crate) committer: Committer,
    pub(crate) webhooks: Arc<Webhooks>,
    pub(crate) registry: Arc<Registry>,
    pub(crate) cage_jobs: Jobs<CageDesign>,
    pub(crate) recoveries: Jobs<Recovery>,
    pub(crate) transfers: Jobs<Transfer>,
    pub(crate) shape_spaces: ShapeSpaces,
    pub(crate) designs: DesignPool,
    /// Recoveries that follow frames or are finished.
    pub(crate) recovering: Arc<Budget>,
    /// Recoveries that keep what they know while they wait for frames or for their turn; each keeps a thread too.
    pub(crate) recoveries_kept: Arc<Budget>,
    /// Transfers that run.
    pub(crate) transferring: Arc<Budget>,
    pub(crate) cage_maker: CageMaker,
    /// Uploaded files being parsed, which keeps a processor busy.
    pub(crate) reading: Arc<Budget>,
    /// Requests in progress, without streams.
    pub(crate) requests: Arc<Budget>,
    streams: Arc<Budget>,
    /// Sessions being completed.
    pub(crate) completing: Arc<Budget>,
    /// Threads that write containers.
    pub(crate) container_writers: Arc<rayon::ThreadPool>,
    /// Groups of frames being coded or decoded.
    pub(crate) coding: Arc<Budget>,
    /// Sessions being written as files of other programs.
    pub(crate) exporting: Arc<Budget>,
    /// Threads that code and decode them.
    pub(crate) coders: Arc<rayon::ThreadPool>,
    /// Frames and cages between arrival and solving.
    pub(crate) queued_frames: Arc<Budget>,
    /// Memory for frames between arrival and solving, in bytes.
    pub(crate) frame_memory: Arc<Budget>,
    /// Memory for uploaded rest poses and cages, in bytes.
    pub(crate) upload_memory: Arc<Budget>,
    /// Memory for downloads being sent, in bytes.
    pub(crate) download_memory: Arc<Budget>,
    /// Memory for the coordinates of those who read completed transfers, in bytes.
    pub(crate) decoding_memory: Arc<Budget>,
    /// Disk space for cages that wait to be decoded, in bytes.
    pub(crate) spool_space: Arc<Budget>,
    stop: CancellationToken,
    resumed: AtomicBool,
    pub(crate) started: Instant,
    /// Time of the last successful disk probe.
    probed: tokio::sync::Mutex<Option<Instant>>,
}

/// Shared resources that a tenant uses.
#[derive(serde::Serialize)]
pub(crate) struct ResourceUse {
    requests: u64,
    streams: u64,
    completing: u64,
    coding: u64,
    preparing: usize,
    queued_frames: u64,
    frame_bytes: u64,
    upload_bytes: u64,
    download_bytes: u64,
    spool_bytes: u64,
}

/// Why the service does not start.
#[derive(Debug, thiserror::Error)]
pub enum StartError {
    /// The data folder cannot be used.
    #[error(transparent)]
    Store(#[from] StoreError),
    /// The tokens file cannot be used.
    #[error(transparent)]
    Access(#[from] crate::auth::AccessError),
    /// The webhooks file cannot be used.
    #[error(transparent)]
    Webhooks(#[from] WebhooksError),
    /// The audit file cannot be used.
    #[error("{}: {cause}; the audit file cannot be written to", path.display())]
    Audit {
        /// The file.
        path: PathBuf,
        /// The system's error.
        cause: std::io::Error,
    },
    /// Threads cannot be started.
    #[error("threads cannot be started: {0}; raise the limit of processes, or lower workers")]
    Threads(std::io::Error),
}

impl Service {
    /// Opens the data folder and resumes its sessions and jobs. Call within a tokio runtime.
    ///
    /// # Errors
    /// See [`StartError`].
    pub fn start(config: ServeConfig, disk: Arc<dyn Disk>, stop: CancellationToken) -> Result<Arc<Self>, StartError> {
        Self::start_with(config, disk, local_designer(), stop)
    }

    /// As [`Self::start`], with another cage designer.
    ///
    /// # Errors
    /// See [`StartError`].
    #[doc(hidden)]
    pub fn start_with(
        config: ServeConfig,
        disk: Arc<dyn Disk>,
        designer: Arc<Designer>,
        stop: CancellationToken,
    ) -> Result<Arc<Self>, StartError> {
        let mut access = Access::open(config.tokens.as_deref(), config.tenant_limits())?;
        if let Some(trust) = config.trust() {
            access = access.with_provider(trust)?;
        }
        let audit = Audit::open(config.audit.as_deref())
            .map_err(|cause| StartError::Audit { path: config.audit.clone().unwrap_or_default(), cause })?;
        let opened = Store::open(
            &config.data,
            disk,
            Shared {
                catalog: config.catalog.as_deref(),
                blobs: config.blobs.as_deref(),
                kept_bytes: config.blobs_kept_bytes,
            },
        )?;
        for damaged in &opened.quarantined {
            tracing::error!(name = %damaged.name, path = %damaged.path.display(), why = %damaged.why, "damaged, and left out");
            metrics::counter!("cager_quarantined_total").increment(1);
        }
        let webhooks = Webhooks::open(config.webhooks.as_deref(), opened.store.clone(), stop.clone())?;
        let owners = opened.sessions.iter().map(|meta| (meta.key, meta.tenant.clone())).collect();
        let engine = Engine::new(config.workers).map_err(StartError::Threads)?;
        let solvers = Arc::new(Solvers::new(opened.store.clone(), &config, &owners).map_err(StartError::Threads)?);
        let container_writers =
            threads::pool("complete", MAX_CONCURRENT_COMPLETIONS as usize, threads::NICE_BACKGROUND);
        let coders = threads::pool("code", config.workers, threads::NICE_BACKGROUND).map_err(StartError::Threads)?;
        let service = Arc::new(Self {
            access,
            audit,
            webhooks,
            store: opened.store,
            engine,
            committer: Committer::start(COMMIT_THREADS).map_err(StartError::Threads)?,
            registry: Arc::default(),
            cage_jobs: Jobs::default(),
            recoveries: Jobs::default(),
            transfers: Jobs::default(),
            shape_spaces: ShapeSpaces::new(config.budget(config.shape_bytes), config.shape_idle_s),
            transferring: config.budget(config.max_transfers as u64),
            designs: DesignPool::new(&config, designer).map_err(StartError::Threads)?,
            recovering: config.budget(config.max_recoveries as u64),
            recoveries_kept: config.budget(config.max_recoveries as u64 + RECOVERIES_KEPT),
            cage_maker: CageMaker::new(config.budget(config.max_preparing as u64), solvers.pool()),
            solvers,
            reading: config.budget(MAX_CONCURRENT_PARSING),
            requests: config.budget(config.max_requests as u64),
            streams: config.budget(config.max_streams as u64),
            completing: config.budget(MAX_CONCURRENT_COMPLETIONS),
            container_writers: Arc::new(container_writers.map_err(StartError::Threads)?),
            coding: config.budget(codings(&coders)),
            exporting: config.budget(MAX_CONCURRENT_EXPORTS),
            coders: Arc::new(coders),
            queued_frames: config.budget(config.max_queue_frames as u64),
            frame_memory: config.budget(config.frame_bytes),
            upload_memory: config.budget(config.upload_bytes),
            download_memory: config.budget(config.download_bytes),
            decoding_memory: config.budget(DECODING_BYTES),
            spool_space: config.budget(config.spool_bytes),
            stop: stop.clone(),
            resumed: AtomicBool::new(false),
            started: Instant::now(),
            probed: tokio::sync::Mutex::default(),
            config,
        });
        let count = opened.sessions.len();
        for meta in opened.sessions {
            service.resume(meta)?;
        }
        let cage_jobs = opened.cage_jobs.len();
        for meta in opened.cage_jobs {
            service.resume_job::<CageDesign>(meta)?;
        }
        let recoveries = opened.recoveries.len();
        for meta in opened.recoveries {
            service.resume_job::<Recovery>(meta)?;
        }
        let transfers = opened.transfers.len();
        for meta in opened.transfers {
            service.resume_job::<Transfer>(meta)?;
        }
        service.orphans().iter().for_each(|key| service.forget_orphan(key));
        service.store.has_started();
        service.resumed.store(true, Ordering::Release);
        tracing::info!(
            sessions = count,
            cage_jobs,
            recoveries,
            transfers,
            quarantined = opened.quarantined.len(),
            "sessions resumed"
        );
        tokio::spawn(Arc::clone(&service).sweep(stop.clone()));
        tokio::spawn(Arc::clone(&service).check_stored(stop.clone()));
        tokio::spawn(Arc::clone(&service).stop_when_taken_over());
        let watching = Arc::clone(&service);
        tokio::spawn(async move { watching.access.clone().watch(stop).await });
        Ok(service)
    }

    /// Stored content that no session uses, left by a crash between storing content and session. Empty while quarantined
    /// sessions may need it. Blocks.
    fn orphans(&self) -> Vec<ContentKey> {
        let found = || -> Result<Vec<ContentKey>, StoreError> {
            if self.store.keeps_contents()? {
                return Ok(Vec::new());
            }
            Ok(self.store.contents()?.into_iter().filter(|key| !self.registry.uses_content(key)).collect())
        };
        found().unwrap_or_else(|error| {
            tracing::warn!(%error, "rest poses and cages of no session may take space");
            Vec::new()
        })
    }

    fn forget_orphan(&self, key: &ContentKey) {
        match self.store.remove_content(key) {
            Ok(()) => tracing::info!(%key, "a rest pose and cage of no session are removed"),
            Err(error) => tracing::warn!(%error, "a rest pose and cage of no session take space"),
        }
    }

    /// Reads frames and containers of all resumed sessions in the background, so that damage is found before a client needs them.
    async fn check_stored(self: Arc<Self>, stop: CancellationToken) {
        for session in self.registry.all() {
            if stop.is_cancelled() {
                return;
            }
            let _ = blocking(move || session.check_stored()).await;
        }
    }

    /// Stops the service where another process has taken its database over.
    async fn stop_when_taken_over(self: Arc<Self>) {
        while !self.stop.is_cancelled() {
            if self.is_taken_over() {
                tracing::error!("another process has taken over the database; this one stops");
                return self.stop.cancel();
            }
            let _ = tokio::time::timeout(TAKEN_OVER_CHECK, self.stop.cancelled()).await;
        }
    }

    /// Whether another process has taken its database over.
    pub(crate) fn is_taken_over(&self) -> bool {
        self.store.is_taken_over()
    }

    /// Cancelled when the service stops.
    pub(crate) fn stopping(&self) -> &CancellationToken {
        &self.stop
    }

    /// Whether requests can be served.
    ///
    /// # Errors
    /// Why not.
    pub(crate) async fn ready(&self) -> Result<(), ApiError> {
        if self.stop.is_cancelled() {
            return Err(ApiError::new(problem::STOPPING, "the service is stopping").retry_after(5));
        }
        if !self.resumed.load(Ordering::Acquire) {
            return Err(ApiError::new(problem::BUSY, "sessions are being resumed").retry_after(1));
        }
        // One probe serves all requests within a second.
        let mut probed = self.probed.lock().await;
        if probed.is_some_and(|then| then.elapsed() < PROBE_VALIDITY) {
            return Ok(());
        }
        let store = self.store.clone();
        let probe = blocking(move || store.probe()).await?;
        *probed = probe.is_ok().then(Instant::now);
        probe.map_err(|error| match error {
            full @ StoreError::Full { .. } => full.into(),
            other => {
                tracing::error!(error = %other, "not ready");
                ApiError::new(problem::STORAGE_FAILED, "the data folder takes no writes; the log has the reason")
                    .retry_after(60)
            }
        })
    }

    /// Counts a request that was turned away.
    pub(crate) fn rejected(&self, reason: &'static str) {
        metrics::counter!("cager_rejections_total", "reason" => reason).increment(1);
    }

    /// A permit for one more stream of a tenant.
    ///
    /// # Errors
    /// All places are taken: 429 where the tenant has its share, 503 where the service has.
    pub(crate) fn stream(&self, tenant: &Tenant) -> Result<Held, ApiError> {
        let most = tenant.limits.max_streams;
        let too_many = || {
            self.rejected("tenant_streams");
            let detail = format!("you have {most} streams open, as many as you may; wait for one to end");
            ApiError::new(problem::TOO_MANY_STREAMS, detail).limit(most).retry_after(2)
        };
        if self.streams.held_by(&tenant.name) >= most {
            return Err(too_many());
        }
        let place = self.streams.try_take(&tenant.name, 1).map_err(|full| {
            self.rejected("streams");
            full.refusal("streams")
        })?;
        // A concurrent request may have exceeded the limit.
        if self.streams.held_by(&tenant.name) > most { Err(too_many()) } else { Ok(place) }
    }

    /// Refuses a stream of frames or cages that would find no room to wait for its turn. Nothing is taken yet: they take their places as they come.
    ///
    /// # Errors
    /// 429 if the tenant has its share, 503 if others hold the rest.
    pub(crate) fn check_queue(&self, tenant: &Tenant) -> Result<(), ApiError> {
        self.queued_frames.try_take(&tenant.name, 1).map(drop).map_err(|full| {
            self.rejected("queue");
            full.refusal("room for frames that wait")
        })
    }

    /// Grows the memory permit of an upload to `bytes` bytes.
    ///
    /// # Errors
    /// 429 if the tenant has its share, 503 if the memory is exhausted.
    pub(crate) fn make_room(&self, room: &mut Held, bytes: u64) -> Result<(), ApiError> {
        room.grow_to(bytes, UPLOAD_PIECE).map_err(|full| {
            self.rejected("upload_memory");
            full.refusal("memory for models").retry_after(5)
        })
    }

    /// Tenants that use shared resources.
    pub(crate) fn tenants_in_use(&self) -> BTreeSet<String> {
        let budgets = [&self.requests, &self.streams, &self.completing, &self.frame_memory, &self.upload_memory];
        let more = [&self.reading, &self.queued_frames, &self.coding, &self.download_memory, &self.spool_space];
        budgets.into_iter().chain(more).flat_map(|budget| budget.tenants()).collect()
    }

    /// Shared resources that a tenant uses.
    pub(crate) fn holds(&self, tenant: &str) -> ResourceUse {
        ResourceUse {
            requests: self.requests.held_by(tenant),
            streams: self.streams.held_by(tenant),
            completing: self.completing.held_by(tenant),
            coding: self.coding.held_by(tenant),
            preparing: self.solvers.in_flight_of(tenant),
            queued_frames: self.queued_frames.held_by(tenant),
            frame_bytes: self.frame_memory.held_by(tenant),
            upload_bytes: self.upload_memory.held_by(tenant),
            download_bytes: self.download_memory.held_by(tenant),
            spool_bytes: self.spool_space.held_by(tenant),
        }
    }

    /// Number of open streams.
    pub(crate) fn open_streams(&self) -> u64 {
        self.streams.used()
    }
}

/// Groups of frames coded or decoded at a time: one for every two threads.
fn codings(threads: &rayon::ThreadPool) -> u64 {
    (threads.current_num_threads() / 2).clamp(1, MAX_CONCURRENT_CODINGS) as u64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn groups_are_coded_beside_each_other_however_the_threads_are_counted() {
        let of = |threads| codings(&threads::pool("code", threads, 0).expect("threads"));
        assert_eq!([1, 2, 4, 6, 64].map(of), [1, 1, 2, 3, 4]);
        // 0: one per processor.
        let processors = std::thread::available_parallelism().map_or(1, usize::from);
        assert_eq!(of(0), of(processors));
    }
}
