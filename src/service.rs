//! The service put together: store, engine, caches, sessions, and how it starts and stops.

use crate::auth::{Access, Tenant};
use crate::cage_job::registry::CageJobs;
use crate::cage_job::{Designer, Designs, local_designer};
use crate::config::ServeConfig;
use crate::engine::Engine;
use crate::problem::{self, ApiError};
use crate::session::cage_source::CageMaker;
use crate::session::commit::Committer;
use crate::session::prepared::Solvers;
use crate::session::registry::Registry;
use crate::store::{Disk, Store, StoreError};
use crate::unread::Unread;
use std::collections::HashMap;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::time::Instant;
use tokio::sync::{OwnedSemaphorePermit, Semaphore};
use tokio_util::sync::CancellationToken;

/// Threads that write frame logs. Most of their time they wait for the disk.
const COMMIT_THREADS: usize = 4;
/// Threads that read new sessions' files at a time.
const READING: usize = 2;

/// How long a look at the disk counts.
const PROBED_FOR: std::time::Duration = std::time::Duration::from_secs(1);

/// Everything the routes work with.
pub struct Service {
    pub(crate) config: ServeConfig,
    pub(crate) access: Access,
    pub(crate) store: Store,
    pub(crate) engine: Engine,
    pub(crate) solvers: Arc<Solvers>,
    pub(crate) committer: Committer,
    pub(crate) registry: Arc<Registry>,
    pub(crate) cage_jobs: CageJobs,
    pub(crate) unread: Unread,
    pub(crate) designs: Designs,
    pub(crate) cage_maker: CageMaker,
    /// Rest poses and cages of new sessions, and cages asked for, being read at a time: parsing keeps a processor busy.
    pub(crate) reading: Semaphore,
    /// Memory for frames on their way, in KiB.
    pub(crate) frame_memory: Memory,
    /// Memory for rest poses and cages on their way, in KiB.
    pub(crate) upload_memory: Memory,
    streams: Arc<Semaphore>,
    tenant_streams: Arc<Mutex<HashMap<String, u64>>>,
    stop: CancellationToken,
    resumed: AtomicBool,
    pub(crate) started: Instant,
    /// When the disk took a write, to see whether it does.
    probed: tokio::sync::Mutex<Option<Instant>>,
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
    /// Threads cannot be started.
    #[error("threads cannot be started: {0}; raise the limit of processes, or lower workers")]
    Threads(std::io::Error),
}

/// A budget of memory, in bytes outside and KiB inside.
pub(crate) struct Memory {
    permits: Arc<Semaphore>,
    total_kib: u32,
}

impl Memory {
    fn new(bytes: u64) -> Self {
        let total_kib = (bytes / 1024).clamp(1, Semaphore::MAX_PERMITS.min(u32::MAX as usize) as u64) as u32;
        Self { permits: Arc::new(Semaphore::new(total_kib as usize)), total_kib }
    }

    /// What is larger than everything takes everything.
    fn kib(&self, bytes: u64) -> u32 {
        u32::try_from(bytes.div_ceil(1024)).unwrap_or(u32::MAX).clamp(1, self.total_kib)
    }

    /// Waits until there is room.
    pub(crate) async fn take(&self, bytes: u64) -> OwnedSemaphorePermit {
        let permits = Arc::clone(&self.permits).acquire_many_owned(self.kib(bytes)).await;
        permits.expect("the semaphore is never closed")
    }

    /// Room now, or none.
    pub(crate) fn try_take(&self, bytes: u64) -> Option<OwnedSemaphorePermit> {
        Arc::clone(&self.permits).try_acquire_many_owned(self.kib(bytes)).ok()
    }

    /// Bytes in use.
    pub(crate) fn used(&self) -> u64 {
        1024 * (u64::from(self.total_kib) - self.permits.available_permits() as u64)
    }
}

impl Service {
    /// Opens the data folder and goes on with the sessions in it. Within a tokio runtime.
    ///
    /// # Errors
    /// See [`StartError`].
    pub fn start(config: ServeConfig, disk: Arc<dyn Disk>, stop: CancellationToken) -> Result<Arc<Self>, StartError> {
        Self::start_with(config, disk, local_designer(), stop)
    }

    /// As [`Self::start`], with another way to design cages.
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
        let access = Access::open(config.tokens.as_deref(), config.tenant_limits())?;
        let opened = Store::open(&config.data, disk)?;
        for damaged in &opened.quarantined {
            tracing::error!(name = %damaged.name, path = %damaged.path.display(), why = %damaged.why, "damaged, and put in quarantine");
            metrics::counter!("cager_quarantined_total").increment(1);
        }
        let unread = Unread::default();
        for left in &opened.unread {
            unread.add(left.kind, &left.name, None, &format!("{}: {}", left.path.display(), left.why));
        }
        let engine = Engine::new(config.workers).map_err(StartError::Threads)?;
        let solvers = Solvers::new(opened.store.clone(), &config).map_err(StartError::Threads)?;
        let service = Arc::new(Self {
            access,
            store: opened.store,
            engine,
            solvers: Arc::new(solvers),
            committer: Committer::start(COMMIT_THREADS).map_err(StartError::Threads)?,
            registry: Arc::default(),
            cage_jobs: CageJobs::default(),
            unread,
            designs: Designs::new(&config, designer).map_err(StartError::Threads)?,
            cage_maker: CageMaker::new(config.max_preparing.max(1)),
            reading: Semaphore::new(READING),
            frame_memory: Memory::new(config.frame_bytes),
            upload_memory: Memory::new(config.upload_bytes),
            streams: Arc::new(Semaphore::new(config.max_streams)),
            tenant_streams: Arc::default(),
            stop: stop.clone(),
            resumed: AtomicBool::new(false),
            started: Instant::now(),
            probed: tokio::sync::Mutex::default(),
            config,
        });
        let count = opened.sessions.len();
        for meta in opened.sessions {
            service.take_in_session(meta);
        }
        let cage_jobs = opened.cage_jobs.len();
        for meta in opened.cage_jobs {
            service.take_in_cage_job(meta);
        }
        service.forget_orphans();
        service.resumed.store(true, Ordering::Release);
        tracing::info!(
            sessions = count,
            cage_jobs,
            quarantined = opened.quarantined.len(),
            unread = service.unread.summary(),
            "sessions resumed"
        );
        tokio::spawn(Arc::clone(&service).sweep(stop.clone()));
        tokio::spawn(Arc::clone(&service).check_logs(stop.clone()));
        let watching = Arc::clone(&service);
        tokio::spawn(async move { watching.access.clone().watch(stop).await });
        Ok(service)
    }

    /// Removes rest poses and cages of no session: a crash between storing them and storing their session leaves them. Not where
    /// something could not be read, which may need them, or is in quarantine, which may be of use with its rest pose only.
    fn forget_orphans(&self) {
        let forget = || -> Result<(), StoreError> {
            if !self.unread.is_empty() || self.store.has_quarantined()? {
                return Ok(());
            }
            for key in self.store.contents()?.iter().filter(|key| !self.registry.uses_content(key)) {
                self.store.remove_content(key)?;
                tracing::info!(%key, "a rest pose and cage of no session are removed");
            }
            Ok(())
        };
        if let Err(error) = forget() {
            tracing::warn!(%error, "rest poses and cages of no session may take space");
        }
    }

    /// Reads the logs of all resumed sessions in the background, so that damage is found before somebody waits for it.
    async fn check_logs(self: Arc<Self>, stop: CancellationToken) {
        for session in self.registry.all() {
            if stop.is_cancelled() {
                return;
            }
            // What is wrong is in the log and in the session.
            let _ = session.ensure_loaded().await;
            session.rest_if_idle();
        }
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
        // One look at the disk answers all who ask within a second.
        let mut probed = self.probed.lock().await;
        if probed.is_some_and(|then| then.elapsed() < PROBED_FOR) {
            return Ok(());
        }
        let store = self.store.clone();
        let probe = crate::session::create::blocking(move || store.probe()).await?;
        *probed = probe.is_ok().then(Instant::now);
        probe.map_err(|error| match error {
            full @ StoreError::Full { .. } => crate::session::commit::storage_error(&full),
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

    /// A place for one more stream of a tenant.
    ///
    /// # Errors
    /// All places are taken: 429 where the tenant has its share, 503 where the service has.
    pub(crate) fn stream(&self, tenant: &Tenant) -> Result<StreamPlace, ApiError> {
        let mut open = crate::session::lock(&self.tenant_streams);
        let mine = open.get(&tenant.name).copied().unwrap_or(0);
        if mine >= tenant.limits.max_streams {
            self.rejected("tenant_streams");
            let detail = format!("you have {mine} streams open, as many as you may; wait for one to end");
            return Err(ApiError::new(problem::TOO_MANY_STREAMS, detail)
                .limit(tenant.limits.max_streams)
                .retry_after(2));
        }
        let waiting = self.engine.waiting();
        let full = waiting >= self.config.max_queue_frames;
        let place = Arc::clone(&self.streams).try_acquire_owned().ok().filter(|_| !full);
        let Some(place) = place else {
            self.rejected(if full { "queue" } else { "streams" });
            let detail = "all streams are taken, or too many frames wait; try again in a moment";
            return Err(ApiError::new(problem::BUSY, detail).retry_after(2));
        };
        *open.entry(tenant.name.clone()).or_insert(0) += 1;
        Ok(StreamPlace { _place: place, tenant: tenant.name.clone(), open: Arc::clone(&self.tenant_streams) })
    }

    /// Streams open now.
    pub(crate) fn open_streams(&self) -> usize {
        self.config.max_streams - self.streams.available_permits()
    }
}

/// A place for a stream; free again when dropped.
pub(crate) struct StreamPlace {
    _place: OwnedSemaphorePermit,
    tenant: String,
    open: Arc<Mutex<HashMap<String, u64>>>,
}

impl Drop for StreamPlace {
    fn drop(&mut self) {
        let mut open = crate::session::lock(&self.open);
        if let Some(count) = open.get_mut(&self.tenant) {
            *count -= 1;
            if *count == 0 {
                open.remove(&self.tenant);
            }
        }
    }
}
