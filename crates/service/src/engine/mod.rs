//! The engine: a bounded pool of solving threads, away from the threads that serve connections.
//!
//! Jobs are queued in lanes, one per session. Up to [`BATCH`] queued jobs of a lane run together, so that frames become the columns of one
//! matrix product. `schedule` chooses the next lane; the lane's closure processes the batch.

mod schedule;
pub(crate) mod threads;

use crate::sync::lock;
use cager_core::inversion::BATCH;
use schedule::{Next, Schedule};
use std::collections::VecDeque;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::{Arc, Condvar, Mutex, PoisonError, Weak};
use std::time::Instant;

/// A pool of solving threads and the queue before it.
pub struct Engine {
    shared: Arc<Shared>,
}

struct Shared {
    state: Mutex<Schedule<Arc<dyn ErasedLane>>>,
    changed: Condvar,
    pool: rayon::ThreadPool,
}

/// A lane with its job type erased.
trait ErasedLane: Send + Sync {
    fn run(&self, count: usize);
}

/// The FIFO queue of one session's jobs. Dropping it discards queued jobs.
pub struct Lane<J: Send + 'static> {
    engine: Weak<Shared>,
    id: u64,
    work: Arc<LaneWork<J>>,
}

struct LaneWork<J> {
    waiting: Mutex<VecDeque<J>>,
    run: Box<dyn Fn(Vec<J>) + Send + Sync>,
}

impl Engine {
    /// Starts `workers` solving threads; 0 means one per processor.
    ///
    /// # Errors
    /// Threads cannot be started.
    pub fn new(workers: usize) -> std::io::Result<Self> {
        let pool = threads::pool("solve", workers, threads::NICE_SOLVE)?;
        let slots = pool.current_num_threads();
        let shared = Arc::new(Shared { state: Mutex::new(Schedule::new(slots)), changed: Condvar::new(), pool });
        let dispatching = Arc::clone(&shared);
        std::thread::Builder::new().name("dispatch".to_owned()).spawn(move || dispatch(&dispatching))?;
        Ok(Self { shared })
    }

    /// Opens a lane. `weight` is its tenant's share of the pool under load; `cost` is the relative cost of a job, in a unit common to all
    /// lanes. `run` processes up to [`BATCH`] jobs on a pool thread.
    pub fn lane<J: Send + 'static>(
        &self,
        tenant: &str,
        weight: f64,
        cost: f64,
        run: impl Fn(Vec<J>) + Send + Sync + 'static,
    ) -> Lane<J> {
        let work = Arc::new(LaneWork { waiting: Mutex::new(VecDeque::new()), run: Box::new(run) });
        let id = lock(&self.shared.state).add(tenant, weight, cost, Arc::clone(&work) as Arc<dyn ErasedLane>);
        Lane { engine: Arc::downgrade(&self.shared), id, work }
    }

    /// As [`Self::lane`], but its batches run one at a time, in order of arrival.
    pub fn lane_in_order<J: Send + 'static>(
        &self,
        tenant: &str,
        weight: f64,
        cost: f64,
        run: impl Fn(Vec<J>) + Send + Sync + 'static,
    ) -> Lane<J> {
        let lane = self.lane(tenant, weight, cost, run);
        lock(&self.shared.state).keep_order(lane.id);
        lane
    }

    /// Number of queued jobs in all lanes.
    pub fn waiting(&self) -> usize {
        lock(&self.shared.state).waiting()
    }

    /// Number of pool threads.
    pub fn workers(&self) -> usize {
        self.shared.pool.current_num_threads()
    }
}

impl Drop for Engine {
    fn drop(&mut self) {
        lock(&self.shared.state).stop();
        self.shared.changed.notify_all();
    }
}

impl<J: Send + 'static> Lane<J> {
    /// Enqueues a job.
    pub fn push(&self, job: J) {
        lock(&self.work.waiting).push_back(job);
        if let Some(engine) = self.engine.upgrade() {
            lock(&engine.state).pushed(self.id, Instant::now());
            engine.changed.notify_all();
        }
    }

    /// Sets whether more jobs are about to arrive. If so, an incomplete batch is delayed a little to fill up.
    pub fn expect_more(&self, more: bool) {
        if let Some(engine) = self.engine.upgrade() {
            lock(&engine.state).expect_more(self.id, more);
            engine.changed.notify_all();
        }
    }
}

impl<J: Send + 'static> Drop for Lane<J> {
    fn drop(&mut self) {
        if let Some(engine) = self.engine.upgrade() {
            lock(&engine.state).remove(self.id);
        }
        let forgotten = std::mem::take(&mut *lock(&self.work.waiting));
        drop(forgotten);
    }
}

impl<J: Send> ErasedLane for LaneWork<J> {
    fn run(&self, count: usize) {
        let jobs: Vec<J> = {
            let mut waiting = lock(&self.waiting);
            let count = count.min(waiting.len());
            waiting.drain(..count).collect()
        };
        if !jobs.is_empty() {
            (self.run)(jobs);
        }
    }
}

/// Passes batches to the pool until the engine is dropped.
fn dispatch(shared: &Arc<Shared>) {
    let mut state = lock(&shared.state);
    loop {
        match state.next(Instant::now(), BATCH) {
            Next::Batch { lane, count, work } => {
                let done = Arc::clone(shared);
                shared.pool.spawn(move || {
                    // Jobs dropped by a panic notify their uploads.
                    if catch_unwind(AssertUnwindSafe(|| work.run(count))).is_err() {
                        tracing::error!("a batch of frames panicked");
                    }
                    drop(work);
                    lock(&done.state).finished(lane, Instant::now());
                    done.changed.notify_all();
                });
            }
            Next::Wait(Some(time)) => {
                state = shared.changed.wait_timeout(state, time).unwrap_or_else(PoisonError::into_inner).0;
            }
            Next::Wait(None) => state = shared.changed.wait(state).unwrap_or_else(PoisonError::into_inner),
            Next::Stopped => return,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::mpsc;
    use std::time::Duration;

    #[test]
    fn what_waits_together_is_run_together_and_in_order() {
        let engine = Engine::new(1).unwrap();
        let (seen, batches) = mpsc::channel();
        let (go, gate) = mpsc::channel::<()>();
        let gate = Mutex::new(gate);
        let lane = engine.lane("a", 1.0, 1.0, move |jobs: Vec<u32>| {
            seen.send(jobs).unwrap();
            gate.lock().unwrap().recv().unwrap();
        });
        lane.push(0);
        assert_eq!(batches.recv_timeout(Duration::from_secs(5)).unwrap(), [0]);
        for job in 1..=20 {
            lane.push(job);
        }
        assert_eq!(engine.waiting(), 20);
        go.send(()).unwrap();
        assert_eq!(batches.recv_timeout(Duration::from_secs(5)).unwrap(), (1..=16).collect::<Vec<_>>());
        go.send(()).unwrap();
        assert_eq!(batches.recv_timeout(Duration::from_secs(5)).unwrap(), [17, 18, 19, 20]);
        go.send(()).unwrap();
    }

    #[test]
    fn a_panic_in_a_batch_costs_that_batch_only() {
        let engine = Engine::new(1).unwrap();
        let (seen, batches) = mpsc::channel();
        let lane = engine.lane("a", 1.0, 1.0, move |jobs: Vec<u32>| {
            assert!(!jobs.contains(&13), "as the test wants");
            seen.send(jobs).unwrap();
        });
        lane.push(13);
        std::thread::sleep(Duration::from_millis(50));
        lane.push(14);
        assert_eq!(batches.recv_timeout(Duration::from_secs(5)).unwrap(), [14]);
    }

    #[test]
    fn a_dropped_lane_forgets_what_waits() {
        let engine = Engine::new(1).unwrap();
        let (go, gate) = mpsc::channel::<()>();
        let gate = Mutex::new(gate);
        let busy = engine.lane("a", 1.0, 1.0, move |_: Vec<u32>| gate.lock().unwrap().recv().unwrap());
        busy.push(1);
        std::thread::sleep(Duration::from_millis(20));
        let (seen, batches) = mpsc::channel();
        let lane = engine.lane("b", 1.0, 1.0, move |jobs: Vec<u32>| seen.send(jobs).unwrap());
        lane.push(1);
        drop(lane);
        assert_eq!(engine.waiting(), 0);
        go.send(()).unwrap();
        assert!(batches.recv_timeout(Duration::from_millis(200)).is_err());
    }
}
