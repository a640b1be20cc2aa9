//! Cache of prepared solvers by content key: in memory up to a budget, then on disk, both shared by tenants. Concurrent requests for the
//! same key share one preparation.

use super::shared_cache::SharedCache;
use super::{Geometry, Prepared, ValidOptions};
use crate::admission::{Budget, Permit};
use crate::config::ServeConfig;
use crate::problem::{self, ApiError};
use crate::resources::Resources;
use crate::store::{Content, ContentKey, Store};
use crate::sync::lock;
use crate::telemetry::traces::TraceSpan;
use cager_proto::messages::{CacheUse, PreparationSeconds};
use opentelemetry::Context;
use std::collections::HashMap;
use std::sync::{Arc, Mutex};
use std::time::Instant;
use tokio::sync::watch;

/// A prepared solver, whether it came from a cache, and what obtaining it took.
#[derive(Clone)]
pub(crate) struct SolverResponse {
    pub(crate) prepared: Arc<Prepared>,
    pub(crate) cache: CacheUse,
    pub(crate) seconds: PreparationSeconds,
}

type ResultSender = watch::Sender<Option<Result<SolverResponse, ApiError>>>;
type ResultReceiver = watch::Receiver<Option<Result<SolverResponse, ApiError>>>;

/// A request for a prepared solver.
pub(crate) struct SolverRequest {
    pub(crate) key: ContentKey,
    pub(crate) tenant: String,
    pub(crate) valid: ValidOptions,
    /// Rest pose and cage, if they have been parsed already.
    pub(crate) geometry: Option<Arc<Geometry>>,
    /// Trace context of the caller.
    pub(crate) trace: Context,
}

/// Solver files read at a time: more would compete for the same disk.
const MAX_CONCURRENT_LOADS: u64 = 4;

/// Solvers in memory.
pub(crate) type KeptSolvers = Mutex<SharedCache<Arc<Prepared>>>;

/// No solvers in memory yet, and room for so many bytes.
pub(crate) fn kept_solvers(budget: Arc<Budget>) -> Arc<KeptSolvers> {
    Arc::new(Mutex::new(SharedCache::new(budget)))
}

/// The cache of solvers.
pub(crate) struct Solvers {
    flights: Mutex<HashMap<ContentKey, PendingSolver>>,
    /// Those in memory, of all services of the process.
    kept: Arc<KeptSolvers>,
    store: Store,
    /// Solver files.
    files: Mutex<SharedCache<()>>,
    /// Largest memory of one preparation, in bytes.
    max_bytes: u64,
    /// Limits concurrent preparations.
    places: Arc<Budget>,
    /// Limits concurrent reads of solver files.
    loads: Arc<Budget>,
    pool: Arc<rayon::ThreadPool>,
}

struct PendingSolver {
    sender: Arc<ResultSender>,
    tenant: String,
}

impl Solvers {
    /// `owners` has the tenants of contents; solver files of others, whose sessions are deleted, are kept
    /// as if they were of one tenant more. Blocks.
    pub(crate) fn new(
        store: Store,
        config: &ServeConfig,
        resources: &Resources,
        owners: &HashMap<ContentKey, String>,
    ) -> Self {
        let solvers = Self {
            flights: Mutex::default(),
            kept: Arc::clone(&resources.kept_solvers),
            files: Mutex::new(SharedCache::new(config.budget(config.prepared_disk_bytes))),
            max_bytes: config.max_prepare_bytes,
            places: Arc::clone(&resources.preparing),
            loads: config.budget(MAX_CONCURRENT_LOADS),
            pool: Arc::clone(&resources.preparers),
            store,
        };
        match solvers.store.prepared_files() {
            Ok(files) => files.into_iter().for_each(|(key, bytes)| {
                solvers.keep_file(owners.get(&key).map_or("", String::as_str), key, bytes);
            }),
            Err(error) => tracing::warn!(%error, "stored solvers are not counted"),
        }
        solvers
    }

    /// A permit to prepare.
    pub(crate) async fn place(&self, tenant: &str) -> Permit {
        self.places.take(tenant, 1).await
    }

    /// The thread pool that prepares.
    pub(crate) fn pool(&self) -> Arc<rayon::ThreadPool> {
        Arc::clone(&self.pool)
    }

    /// The solver of a content if it is in memory.
    pub(crate) fn in_memory(&self, key: &ContentKey) -> Option<Arc<Prepared>> {
        let prepared = lock(&self.kept).get(key).cloned()?;
        metrics::counter!("cager_cache_total", "result" => "memory").increment(1);
        Some(prepared)
    }

    /// Whether a solver file exists for the content, which means that rest pose and cage were validated before.
    pub(crate) fn is_stored(&self, key: &ContentKey) -> bool {
        self.store.has_prepared(key)
    }

    /// Drops all solvers from the cache; returns their size in bytes.
    pub(crate) fn evict(&self) -> u64 {
        let mut kept = lock(&self.kept);
        let bytes = kept.bytes();
        kept.clear();
        bytes
    }

    /// Number of preparations that run or wait.
    pub(crate) fn in_flight(&self) -> usize {
        lock(&self.flights).len()
    }

    /// Number of a tenant's preparations that run or wait.
    pub(crate) fn in_flight_of(&self, tenant: &str) -> usize {
        lock(&self.flights).values().filter(|flight| flight.tenant == tenant).count()
    }

    /// The solver of a content: from memory, from disk, or prepared now. If all callers give up, the preparation is cancelled before its
    /// next step.
    pub(crate) async fn get(self: &Arc<Self>, wanted: SolverRequest) -> Result<SolverResponse, ApiError> {
        if let Some(prepared) = self.in_memory(&wanted.key) {
            return Ok(SolverResponse { prepared, cache: CacheUse::Hit, seconds: PreparationSeconds::default() });
        }
        let (mut flight, mine) = self.join_or_start(wanted);
        let result = flight.wait_for(Option::is_some).await.ok().and_then(|result| result.clone());
        let got = result.unwrap_or_else(|| Err(ApiError::internal(&"a preparation ended without a result")))?;
        // For callers that joined a running preparation it counts as a cache hit.
        Ok(if mine { got } else { SolverResponse { cache: CacheUse::Hit, ..got } })
    }

    /// Joins the running preparation of the content or starts one; and whether it was started here.
    fn join_or_start(self: &Arc<Self>, wanted: SolverRequest) -> (ResultReceiver, bool) {
        let mut flights = lock(&self.flights);
        if let Some(flight) = flights.get(&wanted.key) {
            metrics::counter!("cager_cache_total", "result" => "joined").increment(1);
            return (flight.sender.subscribe(), false);
        }
        let (sender, flight) = watch::channel(None);
        let sender = Arc::new(sender);
        flights.insert(wanted.key, PendingSolver { sender: Arc::clone(&sender), tenant: wanted.tenant.clone() });
        let solvers = Arc::clone(self);
        tokio::spawn(async move { solvers.run_preparation(wanted, &sender).await });
        (flight, true)
    }

    async fn run_preparation(self: Arc<Self>, wanted: SolverRequest, sender: &Arc<ResultSender>) {
        let key = wanted.key;
        let result = loop {
            let attempt = Arc::clone(&self).load_or_prepare(&wanted, sender);
            match attempt.await {
                Some(result) => break result,
                // Unless another caller joined at this moment.
                None if self.cancel_if_unawaited(&key, sender) => return,
                None => {}
            }
        };
        if let Ok(got) = &result {
            self.keep(&wanted.tenant, key, &got.prepared);
        }
        lock(&self.flights).remove(&key);
        let fresh = result.as_ref().ok().filter(|got| got.cache == CacheUse::Miss).map(|got| Arc::clone(&got.prepared));
        // All receivers may be gone.
        let _ = sender.send(Some(result));
        // Stored in the background: without the file the solver is prepared again after a restart.
        if let Some(prepared) = fresh {
            drop(tokio::task::spawn_blocking(move || self.store(&wanted.tenant, key, &prepared)));
        }
    }

    /// Removes a preparation that no caller waits for; false if one has joined.
    fn cancel_if_unawaited(&self, key: &ContentKey, sender: &ResultSender) -> bool {
        let mut flights = lock(&self.flights);
        let off = sender.receiver_count() == 0;
        if off {
            flights.remove(key);
        }
        off
    }

    /// `None` if no caller waits any more.
    async fn load_or_prepare(
        self: Arc<Self>,
        wanted: &SolverRequest,
        sender: &Arc<ResultSender>,
    ) -> Option<Result<SolverResponse, ApiError>> {
        let clock = Instant::now();
        let (key, valid) = (wanted.key, wanted.valid);
        {
            let place = self.loads.take(&wanted.tenant, 1).await;
            let solvers = Arc::clone(&self);
            let load = move || {
                let _place = place;
                solvers.load(&key, &valid, clock)
            };
            let loaded = tokio::task::spawn_blocking(load).await.unwrap_or_else(|e| Err(ApiError::internal(&e)));
            if let Some(done) = loaded.transpose() {
                return Some(done);
            }
        }
        let place = tokio::select! {
            place = self.places.take(&wanted.tenant, 1) => place,
            () = sender.closed() => return None,
        };
        let queued = clock.elapsed().as_secs_f64();
        let _step = TraceSpan::begin("prepare", &wanted.trace);
        let geometry = wanted.geometry.clone();
        let waited_for = Arc::clone(sender);
        let work = move || self.prepare(&key, &valid, geometry, queued, place, &|| !waited_for.is_closed());
        tokio::task::spawn_blocking(work).await.unwrap_or_else(|e| Err(ApiError::internal(&e))).transpose()
    }

    /// The stored solver of a content, if there is one. Blocks.
    fn load(&self, key: &ContentKey, valid: &ValidOptions, clock: Instant) -> Result<Option<SolverResponse>, ApiError> {
        let queued = clock.elapsed().as_secs_f64();
        let solver = match self.store.prepared(key) {
            Ok(Some(solver)) => solver,
            Ok(None) => {
                lock(&self.files).remove(key);
                return Ok(None);
            }
            // The solver is prepared again; the file is kept, since it may be readable later.
            Err(error) => {
                tracing::warn!(%error, "a stored solver cannot be read");
                return Ok(None);
            }
        };
        lock(&self.files).get(key);
        let file = self.store.content_cage(key)?;
        let cage = super::read_cage(&file.ok_or_else(deleted)?, valid)?;
        let options = valid.inversion.options(valid.system.values(&cage).unknowns());
        metrics::counter!("cager_cache_total", "result" => "disk").increment(1);
        let total = clock.elapsed().as_secs_f64();
        let seconds = PreparationSeconds { queued, read: total - queued, total, ..PreparationSeconds::default() };
        let prepared = Arc::new(super::with_solver(solver, &cage, options));
        Ok(Some(SolverResponse { prepared, cache: CacheUse::Hit, seconds }))
    }

    /// Prepares the solver of a content; `None` if `wanted` became false. Blocks.
    fn prepare(
        &self,
        key: &ContentKey,
        valid: &ValidOptions,
        geometry: Option<Arc<Geometry>>,
        queued: f64,
        _place: Permit,
        wanted: &(dyn Fn() -> bool + Sync),
    ) -> Result<Option<SolverResponse>, ApiError> {
        let clock = Instant::now();
        metrics::counter!("cager_cache_total", "result" => "miss").increment(1);
        let geometry = match geometry {
            Some(geometry) => geometry,
            None => Arc::new(super::read(&self.content(key)?, valid)?),
        };
        let read = clock.elapsed().as_secs_f64();
        let prepared = self.pool.install(|| super::prepare(&geometry, valid, self.max_bytes, wanted))?;
        let Some((prepared, [coordinates, maxvol, svd])) = prepared else { return Ok(None) };
        let total = queued + clock.elapsed().as_secs_f64();
        let seconds = PreparationSeconds { queued, read, coordinates, maxvol, svd, total };
        metrics::histogram!("cager_prepare_seconds").record(clock.elapsed().as_secs_f64());
        Ok(Some(SolverResponse { prepared: Arc::new(prepared), cache: CacheUse::Miss, seconds }))
    }

    fn content(&self, key: &ContentKey) -> Result<Content, ApiError> {
        let content = self.store.content(key)?;
        content.ok_or_else(deleted)
    }

    /// Writes a solver file for use after a restart. A failure is only logged, since the solver can be prepared again. Blocks.
    fn store(&self, tenant: &str, key: ContentKey, prepared: &Prepared) {
        match self.store.put_prepared(&key, &prepared.solver) {
            Ok(bytes) => self.keep_file(tenant, key, bytes),
            Err(error) => tracing::warn!(%error, "a solver could not be stored"),
        }
    }

    /// Counts a solver file, and removes those that make room for it. Blocks.
    fn keep_file(&self, tenant: &str, key: ContentKey, bytes: u64) {
        let gone = lock(&self.files).insert(tenant, key, bytes, ());
        for key in gone {
            if let Err(error) = self.store.remove_prepared(&key) {
                tracing::warn!(%error, "a stored solver still takes space");
            }
        }
    }

    fn keep(&self, tenant: &str, key: ContentKey, prepared: &Arc<Prepared>) {
        let gone = lock(&self.kept).insert(tenant, key, prepared.solver.size_bytes() as u64, Arc::clone(prepared));
        metrics::counter!("cager_cache_evictions_total")
            .increment(gone.iter().filter(|gone| **gone != key).count() as u64);
    }
}

fn deleted() -> ApiError {
    ApiError::new(problem::SESSION_DELETED, "the session was deleted before it was prepared")
}
