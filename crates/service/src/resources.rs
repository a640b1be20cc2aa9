//! What a process has for its service: who may ask, threads, memory, and the places of tenants.

use crate::admission::{Budget, Permit};
use crate::audit::Audit;
use crate::auth::{Access, Tenant};
use crate::cage_job::{DesignPool, Designer};
use crate::config::ServeConfig;
use crate::engine::{Engine, threads};
use crate::preparation::{KeptSolvers, kept_solvers};
use crate::problem::{self, ApiError};
use crate::session::commit::Committer;
use crate::store::StoreError;
use crate::telemetry::REJECTIONS;
use crate::webhooks::WebhooksError;
use std::collections::BTreeSet;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Instant;

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

/// Sessions written as files of other programs at a time.
const MAX_CONCURRENT_EXPORTS: u64 = 2;

/// What is there before the data folder is opened, and while it is waited for.
pub struct Resources {
    pub(crate) access: Access,
    pub(crate) audit: Audit,
    pub(crate) engine: Engine,
    pub(crate) committer: Committer,
    pub(crate) designs: DesignPool,
    /// Recoveries that follow frames or are finished.
    pub(crate) recovering: Arc<Budget>,
    /// Recoveries that keep what they know while they wait for frames or for their turn; each keeps a thread too.
    pub(crate) recoveries_kept: Arc<Budget>,
    /// Transfers that run.
    pub(crate) transferring: Arc<Budget>,
    /// Memory of shape spaces, in bytes.
    pub(crate) shape_memory: Arc<Budget>,
    /// Solvers in memory.
    pub(crate) kept_solvers: Arc<KeptSolvers>,
    /// Solvers being prepared and cages being made, each of both.
    pub(crate) preparing: Arc<Budget>,
    pub(crate) making_cages: Arc<Budget>,
    /// Threads that do that.
    pub(crate) preparers: Arc<rayon::ThreadPool>,
    /// Uploaded files being parsed, which keeps a processor busy.
    pub(crate) parse_slots: Arc<Budget>,
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
    pub(crate) started: Instant,
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

impl Resources {
    /// Starts the threads, and reads the files that say who may ask.
    ///
    /// # Errors
    /// See [`StartError`].
    pub(crate) fn new(config: &ServeConfig, designer: Arc<Designer>) -> Result<Arc<Self>, StartError> {
        let mut access = Access::open(config.tokens.as_deref(), config.tenant_limits())?;
        if let Some(trust) = config.trust() {
            access = access.with_provider(trust)?;
        }
        let audit = Audit::open(config.audit.as_deref())
            .map_err(|cause| StartError::Audit { path: config.audit.clone().unwrap_or_default(), cause })?;
        let pool = |name, threads, nice| threads::pool(name, threads, nice).map_err(StartError::Threads);
        let coders = pool("code", config.workers, threads::NICE_BACKGROUND)?;
        let writers = pool("complete", MAX_CONCURRENT_COMPLETIONS as usize, threads::NICE_BACKGROUND)?;
        Ok(Arc::new(Self {
            access,
            audit,
            engine: Engine::new(config.workers).map_err(StartError::Threads)?,
            committer: Committer::default(),
            designs: DesignPool::new(config, designer).map_err(StartError::Threads)?,
            recovering: config.budget(config.max_recoveries as u64),
            recoveries_kept: config.budget(config.max_recoveries as u64 + RECOVERIES_KEPT),
            transferring: config.budget(config.max_transfers as u64),
            shape_memory: config.budget(config.shape_bytes),
            kept_solvers: kept_solvers(config.budget(config.cache_bytes)),
            preparing: config.budget(config.max_preparing as u64),
            making_cages: config.budget(config.max_preparing as u64),
            preparers: Arc::new(pool("prepare", config.workers, threads::NICE_BACKGROUND)?),
            parse_slots: config.budget(MAX_CONCURRENT_PARSING),
            requests: config.budget(config.max_requests as u64),
            streams: config.budget(config.max_streams as u64),
            completing: config.budget(MAX_CONCURRENT_COMPLETIONS),
            container_writers: Arc::new(writers),
            coding: config.budget(codings(&coders)),
            exporting: config.budget(MAX_CONCURRENT_EXPORTS),
            coders: Arc::new(coders),
            queued_frames: config.budget(config.max_queue_frames as u64),
            frame_memory: config.budget(config.frame_bytes),
            upload_memory: config.budget(config.upload_bytes),
            download_memory: config.budget(config.download_bytes),
            decoding_memory: config.budget(DECODING_BYTES),
            spool_space: config.budget(config.spool_bytes),
            started: Instant::now(),
        }))
    }

    /// Counts a request that was turned away.
    pub(crate) fn rejected(&self, reason: &'static str) {
        debug_assert!(REJECTIONS.contains(&reason), "{reason} does not begin at 0");
        metrics::counter!("cager_rejections_total", "reason" => reason).increment(1);
    }

    /// A permit for one more stream of a tenant.
    ///
    /// # Errors
    /// All places are taken: 429 where the tenant has its share, 503 where the service has.
    pub(crate) fn stream(&self, tenant: &Tenant) -> Result<Permit, ApiError> {
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
    pub(crate) fn make_room(&self, room: &mut Permit, bytes: u64) -> Result<(), ApiError> {
        room.grow_to(bytes, UPLOAD_PIECE).map_err(|full| {
            self.rejected("upload_memory");
            full.refusal("memory for models").retry_after(5)
        })
    }

    /// Tenants that use shared resources.
    pub(crate) fn tenants_in_use(&self) -> BTreeSet<String> {
        let budgets = [&self.requests, &self.streams, &self.completing, &self.frame_memory, &self.upload_memory];
        let more = [&self.parse_slots, &self.queued_frames, &self.coding, &self.download_memory, &self.spool_space];
        budgets.into_iter().chain(more).flat_map(|budget| budget.tenants()).collect()
    }

    /// Shared resources that a tenant uses.
    pub(crate) fn holds(&self, tenant: &str, preparing: usize) -> ResourceUse {
        ResourceUse {
            requests: self.requests.held_by(tenant),
            streams: self.streams.held_by(tenant),
            completing: self.completing.held_by(tenant),
            coding: self.coding.held_by(tenant),
            preparing,
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
