//! Prepared solvers by content: in memory up to a budget, on disk beyond, each prepared once however many ask.

use super::prepare::{self, Choices, Geometry};
use crate::admission::{Budget, Held};
use crate::config::ServeConfig;
use crate::engine::threads;
use crate::problem::{self, ApiError};
use crate::store::{CageFile, Content, ContentKey, Store};
use crate::telemetry::traces::Step;
use cager_core::inversion::{Solver, SolverOptions};
use cager_proto::messages::{CacheUse, PreparationSeconds};
use opentelemetry::Context;
use std::collections::HashMap;
use std::sync::{Arc, Mutex};
use std::time::Instant;
use tokio::sync::{Semaphore, watch};

/// A solver with what goes with it.
pub(crate) struct Prepared {
    pub(crate) solver: Solver,
    pub(crate) options: SolverOptions,
    pub(crate) handles_digest: String,
    pub(crate) cage_vertices: u32,
    pub(crate) cage_faces: u32,
    pub(crate) warnings: Vec<String>,
}

/// How a request for a solver ended.
#[derive(Clone)]
pub(crate) struct Got {
    pub(crate) prepared: Arc<Prepared>,
    pub(crate) cache: CacheUse,
    pub(crate) seconds: PreparationSeconds,
}

type Landing = watch::Sender<Option<Result<Got, ApiError>>>;
type Flight = watch::Receiver<Option<Result<Got, ApiError>>>;

/// A solver that somebody waits for.
pub(crate) struct Wanted {
    pub(crate) key: ContentKey,
    pub(crate) tenant: String,
    pub(crate) choices: Choices,
    /// Rest pose and cage where they have been read already.
    pub(crate) geometry: Option<Arc<Geometry>>,
    /// The trace of who asks.
    pub(crate) trace: Context,
}

/// Stored solvers read at a time: the disk decides how fast that is.
const LOADS: usize = 4;

/// The cache of solvers.
pub(crate) struct Solvers {
    inner: Mutex<Inner>,
    store: Store,
    budget_bytes: u64,
    disk_budget_bytes: u64,
    /// Memory that one preparation may take.
    most_bytes: u64,
    /// Solvers being prepared at a time.
    places: Arc<Budget>,
    /// Solvers being read from disk at a time.
    loads: Semaphore,
    pool: Arc<rayon::ThreadPool>,
}

#[derive(Default)]
struct Inner {
    kept: HashMap<ContentKey, Kept>,
    bytes: u64,
    clock: u64,
    flights: HashMap<ContentKey, InFlight>,
}

struct InFlight {
    landing: Arc<Landing>,
    tenant: String,
}

struct Kept {
    prepared: Arc<Prepared>,
    bytes: u64,
    used: u64,
}

impl Solvers {
    /// Starts the threads that prepare.
    ///
    /// # Errors
    /// The system's, where threads cannot be started.
    pub(crate) fn new(store: Store, config: &ServeConfig) -> std::io::Result<Self> {
        let pool = threads::pool("prepare", config.workers, threads::GIVES_WAY)?;
        Ok(Self {
            inner: Mutex::default(),
            store,
            budget_bytes: config.cache_bytes,
            disk_budget_bytes: config.prepared_disk_bytes,
            most_bytes: config.max_prepare_bytes,
            places: config.budget(config.max_preparing as u64),
            loads: Semaphore::new(LOADS),
            pool: Arc::new(pool),
        })
    }

    /// A place among what may be prepared at a time.
    pub(crate) async fn place(&self, tenant: &str) -> Held {
        self.places.take(tenant, 1).await
    }

    /// The threads that prepare.
    pub(crate) fn pool(&self) -> Arc<rayon::ThreadPool> {
        Arc::clone(&self.pool)
    }

    /// The solver of a content if it is in memory.
    pub(crate) fn at_hand(&self, key: &ContentKey) -> Option<Arc<Prepared>> {
        let mut inner = super::lock(&self.inner);
        inner.clock += 1;
        let clock = inner.clock;
        let kept = inner.kept.get_mut(key)?;
        kept.used = clock;
        metrics::counter!("cager_cache_total", "result" => "memory").increment(1);
        Some(Arc::clone(&kept.prepared))
    }

    /// Whether the solver of a content is stored, so that its rest pose and cage are known to be good.
    pub(crate) fn is_stored(&self, key: &ContentKey) -> bool {
        self.store.has_prepared(key)
    }

    /// Frees what is kept in memory; gives how many bytes that was.
    pub(crate) fn evict(&self) -> u64 {
        let mut inner = super::lock(&self.inner);
        inner.kept.clear();
        metrics::gauge!("cager_cache_bytes", "cache" => "solvers").set(0.0);
        std::mem::take(&mut inner.bytes)
    }

    /// Preparations that run or wait.
    pub(crate) fn in_flight(&self) -> usize {
        super::lock(&self.inner).flights.len()
    }

    /// Preparations that run or wait for one tenant.
    pub(crate) fn in_flight_of(&self, tenant: &str) -> usize {
        super::lock(&self.inner).flights.values().filter(|flight| flight.tenant == tenant).count()
    }

    /// The solver of a content: from memory, from disk, or prepared now. Where all give up, it is not prepared, or
    /// only to the end of the step that is being computed.
    pub(crate) async fn get(self: &Arc<Self>, wanted: Wanted) -> Result<Got, ApiError> {
        if let Some(prepared) = self.at_hand(&wanted.key) {
            return Ok(Got { prepared, cache: CacheUse::Hit, seconds: PreparationSeconds::default() });
        }
        let (mut flight, mine) = self.board(wanted);
        loop {
            if let Some(result) = flight.borrow_and_update().clone() {
                // Who only came along found it prepared.
                return result.map(|got| if mine { got } else { Got { cache: CacheUse::Hit, ..got } });
            }
            if flight.changed().await.is_err() {
                return Err(ApiError::internal(&"a preparation ended without a result"));
            }
        }
    }

    /// The flight that prepares a content, begun if there is none; and whether it was begun here.
    fn board(self: &Arc<Self>, wanted: Wanted) -> (Flight, bool) {
        let mut inner = super::lock(&self.inner);
        if let Some(flight) = inner.flights.get(&wanted.key) {
            metrics::counter!("cager_cache_total", "result" => "joined").increment(1);
            return (flight.landing.subscribe(), false);
        }
        let (landing, flight) = watch::channel(None);
        let landing = Arc::new(landing);
        inner.flights.insert(wanted.key, InFlight { landing: Arc::clone(&landing), tenant: wanted.tenant.clone() });
        let solvers = Arc::clone(self);
        tokio::spawn(async move { solvers.fly(wanted, &landing).await });
        (flight, true)
    }

    async fn fly(self: Arc<Self>, wanted: Wanted, landing: &Arc<Landing>) {
        let key = wanted.key;
        let result = loop {
            let flying = Arc::clone(&self).load_or_prepare(&wanted, landing);
            match flying.await {
                Some(result) => break result,
                // Unless somebody came along just now.
                None if self.called_off(&key, landing) => return,
                None => {}
            }
        };
        if let Ok(got) = &result {
            self.keep(key, &got.prepared);
        }
        super::lock(&self.inner).flights.remove(&key);
        let fresh = result.as_ref().ok().filter(|got| got.cache == CacheUse::Miss).map(|got| Arc::clone(&got.prepared));
        // Nobody may be listening any more.
        let _ = landing.send(Some(result));
        // Nobody has to wait for it: without it the same solver is prepared again.
        if let Some(prepared) = fresh {
            drop(tokio::task::spawn_blocking(move || self.store(&key, &prepared)));
        }
    }

    /// Takes a flight back that nobody waits for.
    fn called_off(&self, key: &ContentKey, landing: &Landing) -> bool {
        let mut inner = super::lock(&self.inner);
        let off = landing.receiver_count() == 0;
        if off {
            inner.flights.remove(key);
        }
        off
    }

    /// None where nobody waits for it any more.
    async fn load_or_prepare(
        self: Arc<Self>,
        wanted: &Wanted,
        landing: &Arc<Landing>,
    ) -> Option<Result<Got, ApiError>> {
        let clock = Instant::now();
        let (key, choices) = (wanted.key, wanted.choices);
        {
            let _one_of_few = self.loads.acquire().await;
            let solvers = Arc::clone(&self);
            let load = move || solvers.load(&key, &choices, clock);
            let loaded = tokio::task::spawn_blocking(load).await.unwrap_or_else(|e| Err(ApiError::internal(&e)));
            if let Some(done) = loaded.transpose() {
                return Some(done);
            }
        }
        let place = tokio::select! {
            place = self.places.take(&wanted.tenant, 1) => place,
            () = landing.closed() => return None,
        };
        let queued = clock.elapsed().as_secs_f64();
        let _step = Step::begin("prepare", &wanted.trace);
        let geometry = wanted.geometry.clone();
        let waited_for = Arc::clone(landing);
        let work = move || self.prepare(&key, &choices, geometry, queued, place, &|| !waited_for.is_closed());
        tokio::task::spawn_blocking(work).await.unwrap_or_else(|e| Err(ApiError::internal(&e))).transpose()
    }

    /// The stored solver of a content, if there is one. Blocks.
    fn load(&self, key: &ContentKey, choices: &Choices, clock: Instant) -> Result<Option<Got>, ApiError> {
        let queued = clock.elapsed().as_secs_f64();
        let solver = match self.store.prepared(key) {
            Ok(Some(solver)) => solver,
            Ok(None) => return Ok(None),
            // Preparing again mends it.
            Err(error) => {
                tracing::warn!(%error, "a stored solver cannot be read");
                return Ok(None);
            }
        };
        let file = self.store.content_cage(key).map_err(|error| super::commit::storage_error(&error))?;
        let CageFile { name, bytes } = file.ok_or_else(deleted)?;
        let cage = prepare::read_cage(&name, &bytes, choices)?;
        let options = choices.solver_options(choices.system.unknowns(&cage));
        metrics::counter!("cager_cache_total", "result" => "disk").increment(1);
        let total = clock.elapsed().as_secs_f64();
        let seconds = PreparationSeconds { queued, read: total - queued, total, ..PreparationSeconds::default() };
        let prepared = Arc::new(prepare::with_solver(solver, &cage, options));
        Ok(Some(Got { prepared, cache: CacheUse::Hit, seconds }))
    }

    /// Prepares the solver of a content, or some of it where it is not `wanted` any more. Blocks.
    fn prepare(
        &self,
        key: &ContentKey,
        choices: &Choices,
        geometry: Option<Arc<Geometry>>,
        queued: f64,
        _place: Held,
        wanted: &(dyn Fn() -> bool + Sync),
    ) -> Result<Option<Got>, ApiError> {
        let clock = Instant::now();
        metrics::counter!("cager_cache_total", "result" => "miss").increment(1);
        let geometry = match geometry {
            Some(geometry) => geometry,
            None => Arc::new(prepare::read(&self.content(key)?, choices)?),
        };
        let read = clock.elapsed().as_secs_f64();
        let prepared = self.pool.install(|| prepare::prepare(&geometry, choices, self.most_bytes, wanted))?;
        let Some(prepared) = prepared else { return Ok(None) };
        let found = prepared.solver.preparation();
        let seconds = PreparationSeconds {
            queued,
            read,
            coordinates: found.coordinates_seconds,
            maxvol: found.maxvol_seconds,
            svd: found.svd_seconds,
            total: queued + clock.elapsed().as_secs_f64(),
        };
        metrics::histogram!("cager_prepare_seconds").record(clock.elapsed().as_secs_f64());
        Ok(Some(Got { prepared: Arc::new(prepared), cache: CacheUse::Miss, seconds }))
    }

    fn content(&self, key: &ContentKey) -> Result<Content, ApiError> {
        let content = self.store.content(key).map_err(|error| super::commit::storage_error(&error))?;
        content.ok_or_else(deleted)
    }

    /// Stores a solver for after a restart. Blocks. One that cannot be written costs time only.
    fn store(&self, key: &ContentKey, prepared: &Prepared) {
        let kept = self.store.put_prepared(key, &prepared.solver);
        if let Err(error) = kept.and_then(|()| self.store.trim_prepared(self.disk_budget_bytes).map(|_| ())) {
            tracing::warn!(%error, "a solver could not be stored");
        }
    }

    fn keep(&self, key: ContentKey, prepared: &Arc<Prepared>) {
        let bytes = prepared.solver.size_bytes() as u64;
        let mut inner = super::lock(&self.inner);
        inner.clock += 1;
        let used = inner.clock;
        if bytes <= self.budget_bytes {
            let old = inner.kept.insert(key, Kept { prepared: Arc::clone(prepared), bytes, used });
            inner.bytes += bytes;
            inner.bytes -= old.map_or(0, |old| old.bytes);
        }
        while inner.bytes > self.budget_bytes {
            let Some((&oldest, _)) = inner.kept.iter().min_by_key(|(_, kept)| kept.used) else { break };
            let gone = inner.kept.remove(&oldest);
            inner.bytes -= gone.map_or(0, |gone| gone.bytes);
            metrics::counter!("cager_cache_evictions_total").increment(1);
        }
        metrics::gauge!("cager_cache_bytes", "cache" => "solvers").set(inner.bytes as f64);
    }
}

fn deleted() -> ApiError {
    ApiError::new(problem::SESSION_DELETED, "the session was deleted before it was prepared")
}
