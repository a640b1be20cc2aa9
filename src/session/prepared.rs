//! Prepared solvers by content: in memory up to a budget, on disk beyond, each prepared once however many ask.

use super::prepare::{self, Choices};
use crate::config::ServeConfig;
use crate::problem::{self, ApiError};
use crate::store::{ContentKey, Store};
use cager_core::inversion::{Solver, SolverOptions};
use cager_proto::messages::{CacheUse, PreparationSeconds};
use std::collections::HashMap;
use std::sync::{Arc, Mutex};
use std::time::Instant;
use tokio::sync::{Semaphore, watch};

/// A solver with what goes with it.
pub(crate) struct Prepared {
    pub(crate) solver: Solver,
    pub(crate) options: SolverOptions,
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

type Flight = watch::Receiver<Option<Result<Got, ApiError>>>;

/// The cache of solvers.
pub(crate) struct Solvers {
    inner: Mutex<Inner>,
    store: Store,
    budget_bytes: u64,
    disk_budget_bytes: u64,
    /// Memory that one preparation may take.
    most_bytes: u64,
    /// Solvers being prepared at a time.
    places: Semaphore,
    pool: Arc<rayon::ThreadPool>,
}

#[derive(Default)]
struct Inner {
    kept: HashMap<ContentKey, Kept>,
    bytes: u64,
    clock: u64,
    flights: HashMap<ContentKey, Flight>,
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
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(config.workers)
            .thread_name(|k| format!("prepare-{k}"))
            .build()
            .map_err(std::io::Error::other)?;
        Ok(Self {
            inner: Mutex::default(),
            store,
            budget_bytes: config.cache_bytes,
            disk_budget_bytes: config.prepared_disk_bytes,
            most_bytes: config.max_prepare_bytes,
            places: Semaphore::new(config.max_preparing.max(1)),
            pool: Arc::new(pool),
        })
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

    /// Preparations that run or wait.
    pub(crate) fn in_flight(&self) -> usize {
        super::lock(&self.inner).flights.len()
    }

    /// The solver of a content: from memory, from disk, or prepared now. Goes on where the caller gives up.
    pub(crate) async fn get(self: &Arc<Self>, key: ContentKey, choices: Choices) -> Result<Got, ApiError> {
        if let Some(prepared) = self.at_hand(&key) {
            return Ok(Got { prepared, cache: CacheUse::Hit, seconds: PreparationSeconds::default() });
        }
        let (mut flight, mine) = self.board(key, choices);
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
    fn board(self: &Arc<Self>, key: ContentKey, choices: Choices) -> (Flight, bool) {
        let mut inner = super::lock(&self.inner);
        if let Some(flight) = inner.flights.get(&key) {
            metrics::counter!("cager_cache_total", "result" => "joined").increment(1);
            return (flight.clone(), false);
        }
        let (landed, flight) = watch::channel(None);
        inner.flights.insert(key, flight.clone());
        let solvers = Arc::clone(self);
        tokio::spawn(async move {
            let clock = Instant::now();
            let result = {
                let _place = solvers.places.acquire().await;
                let queued = clock.elapsed().as_secs_f64();
                let working = Arc::clone(&solvers);
                let work = move || working.load_or_prepare(key, choices, queued);
                tokio::task::spawn_blocking(work).await.unwrap_or_else(|e| Err(ApiError::internal(&e)))
            };
            if let Ok(got) = &result {
                solvers.keep(key, &got.prepared);
            }
            super::lock(&solvers.inner).flights.remove(&key);
            // Nobody may be listening any more.
            let fresh =
                result.as_ref().ok().filter(|got| got.cache == CacheUse::Miss).map(|got| Arc::clone(&got.prepared));
            let _ = landed.send(Some(result));
            // Nobody has to wait for it: without it the same solver is prepared again.
            if let Some(prepared) = fresh {
                drop(tokio::task::spawn_blocking(move || solvers.store(&key, &prepared)));
            }
        });
        (flight, true)
    }

    fn load_or_prepare(&self, key: ContentKey, choices: Choices, queued: f64) -> Result<Got, ApiError> {
        let clock = Instant::now();
        let stored = |error| super::commit::storage_error(&error);
        let content =
            self.store.content(&key).map_err(stored)?.ok_or_else(|| {
                ApiError::new(problem::SESSION_DELETED, "the session was deleted before it was prepared")
            })?;
        match self.store.prepared(&key) {
            Ok(Some(solver)) => {
                let cage = prepare::read_cage(&content, &choices)?;
                let options = choices.solver_options(choices.system.unknowns(&cage));
                metrics::counter!("cager_cache_total", "result" => "disk").increment(1);
                let seconds = PreparationSeconds {
                    queued,
                    read: clock.elapsed().as_secs_f64(),
                    total: queued + clock.elapsed().as_secs_f64(),
                    ..PreparationSeconds::default()
                };
                let prepared = Arc::new(prepare::with_solver(solver, &cage, options));
                return Ok(Got { prepared, cache: CacheUse::Hit, seconds });
            }
            Ok(None) => {}
            // Preparing again mends it.
            Err(error) => tracing::warn!(%error, "a stored solver cannot be read"),
        }
        metrics::counter!("cager_cache_total", "result" => "miss").increment(1);
        let geometry = prepare::read(&content, &choices)?;
        let read = clock.elapsed().as_secs_f64();
        let prepared = self.pool.install(|| prepare::prepare(&geometry, &choices, self.most_bytes))?;
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
        Ok(Got { prepared: Arc::new(prepared), cache: CacheUse::Miss, seconds })
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
