//! The service: store, engine, caches, registries and background tasks; startup and shutdown.

use crate::cage_job::{CageDesign, Designer, local_designer};
use crate::config::ServeConfig;
use crate::jobs::Jobs;
use crate::preparation::{CageMaker, Solvers};
use crate::problem::{self, ApiError};
use crate::readiness::Readiness;
use crate::recovery::Recovery;
use crate::resources::Resources;
pub use crate::resources::StartError;
use crate::session::registry::Registry;
use crate::shape_spaces::ShapeSpaces;
use crate::store::{ContentKey, Disk, Opened, Shared, Store, StoreError};
use crate::tasks::blocking;
use crate::transfers::Transfer;
use crate::webhooks::Webhooks;
use std::ops::Deref;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use tokio_util::sync::CancellationToken;

/// How often it is looked whether another process has the database.
const TAKEN_OVER_CHECK: std::time::Duration = std::time::Duration::from_millis(200);

/// State shared by all request handlers.
pub struct Service {
    pub(crate) config: ServeConfig,
    resources: Arc<Resources>,
    pub(crate) store: Store,
    pub(crate) solvers: Arc<Solvers>,
    pub(crate) webhooks: Arc<Webhooks>,
    pub(crate) registry: Arc<Registry>,
    pub(crate) cage_jobs: Arc<Jobs<CageDesign>>,
    pub(crate) recoveries: Arc<Jobs<Recovery>>,
    pub(crate) transfers: Arc<Jobs<Transfer>>,
    pub(crate) shape_spaces: ShapeSpaces,
    pub(crate) cage_maker: CageMaker,
    stop: CancellationToken,
    resumed: AtomicBool,
    readiness: Readiness,
}

impl Deref for Service {
    type Target = Resources;

    fn deref(&self) -> &Resources {
        &self.resources
    }
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
        let resources = Resources::new(&config, designer)?;
        tokio::spawn(resources.access.clone().watch(stop.clone()));
        Self::open(resources, config, disk, stop)
    }

    /// As [`Self::start`], where threads and budgets are there already: it may be tried again.
    ///
    /// # Errors
    /// See [`StartError`].
    pub(crate) fn open(
        resources: Arc<Resources>,
        config: ServeConfig,
        disk: Arc<dyn Disk>,
        stop: CancellationToken,
    ) -> Result<Arc<Self>, StartError> {
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
        let (store, stopping) = (opened.store.clone(), stop.clone());
        Self::of_opened(resources, config, opened, stop).inspect_err(|_| {
            // What has begun already ends, and another process may try.
            stopping.cancel();
            store.release();
        })
    }

    /// The service of what is stored.
    fn of_opened(
        resources: Arc<Resources>,
        config: ServeConfig,
        opened: Opened,
        stop: CancellationToken,
    ) -> Result<Arc<Self>, StartError> {
        let webhooks = Webhooks::open(config.webhooks.as_deref(), opened.store.clone(), stop.clone())?;
        let owners = opened.sessions.iter().map(|meta| (meta.key, meta.tenant.clone())).collect();
        let solvers = Arc::new(Solvers::new(opened.store.clone(), &config, &resources, &owners));
        let service = Arc::new(Self {
            webhooks,
            store: opened.store,
            registry: Arc::default(),
            cage_jobs: Arc::default(),
            recoveries: Arc::default(),
            transfers: Arc::default(),
            shape_spaces: ShapeSpaces::new(Arc::clone(&resources.shape_memory), config.shape_idle_s),
            cage_maker: CageMaker::new(Arc::clone(&resources.making_cages), solvers.pool()),
            solvers,
            stop: stop.clone(),
            resumed: AtomicBool::new(false),
            readiness: Readiness::default(),
            resources,
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
        tokio::spawn(Arc::clone(&service).check_stored(stop));
        tokio::spawn(Arc::clone(&service).stop_when_taken_over());
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
        self.readiness.look(&self.store).await
    }
}
