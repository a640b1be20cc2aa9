//! Weighted fair scheduling: tenants by stride scheduling (Waldspurger and Weihl 1995), the lanes of a tenant in round-robin order.
//!
//! Each tenant has a pass value that grows by the cost of its batches divided by its weight; the tenant with the smallest pass is served
//! next.

use std::collections::{BTreeMap, HashMap};
use std::time::{Duration, Instant};

/// How long an incomplete batch waits for more frames of a running upload.
const BATCH_DELAY: Duration = Duration::from_millis(2);
/// A lane whose last batch ended less than this ago belongs to a running upload; other lanes are served at once.
const BUSY_WINDOW: Duration = Duration::from_millis(20);

/// The next step of the dispatcher.
pub(super) enum Next<W> {
    /// Run this many jobs of a lane.
    Batch { lane: u64, count: usize, work: W },
    /// Nothing is ready; wait for a change, or for this long.
    Wait(Option<Duration>),
    /// The engine was stopped.
    Stopped,
}

/// Queued and running jobs by lane and tenant. It counts jobs only; the lanes hold them.
pub(super) struct Schedule<W> {
    lanes: HashMap<u64, LaneState<W>>,
    tenants: BTreeMap<String, Tenant>,
    next_id: u64,
    slots: usize,
    running: usize,
    waiting: usize,
    /// Largest pass value of any tenant so far.
    time: f64,
    stopped: bool,
}

struct LaneState<W> {
    tenant: String,
    cost: f64,
    work: W,
    waiting: usize,
    running: usize,
    oldest: Instant,
    last_finished: Option<Instant>,
    more: bool,
    /// Whether its batches run one after another.
    in_order: bool,
    /// Value of the tenant's `turn` when the lane was last served; the lane with the smallest is next, which makes the order round-robin.
    served: u64,
}

struct Tenant {
    weight: f64,
    pass: f64,
    lanes: Vec<u64>,
    waiting: usize,
    turn: u64,
}

impl<W: Clone> Schedule<W> {
    pub(super) fn new(slots: usize) -> Self {
        Self {
            lanes: HashMap::new(),
            tenants: BTreeMap::new(),
            next_id: 0,
            slots,
            running: 0,
            waiting: 0,
            time: 0.0,
            stopped: false,
        }
    }

    pub(super) fn add(&mut self, tenant: &str, weight: f64, cost: f64, work: W) -> u64 {
        let id = self.next_id;
        self.next_id += 1;
        let entry = self.tenants.entry(tenant.to_owned()).or_insert(Tenant {
            weight,
            pass: 0.0,
            lanes: Vec::new(),
            waiting: 0,
            turn: 0,
        });
        entry.weight = weight.max(1e-3);
        entry.lanes.push(id);
        let lane = LaneState {
            tenant: tenant.to_owned(),
            cost,
            work,
            waiting: 0,
            running: 0,
            oldest: Instant::now(),
            last_finished: None,
            more: false,
            in_order: false,
            served: 0,
        };
        self.lanes.insert(id, lane);
        id
    }

    pub(super) fn remove(&mut self, id: u64) {
        let Some(lane) = self.lanes.remove(&id) else { return };
        self.waiting -= lane.waiting;
        if let Some(tenant) = self.tenants.get_mut(&lane.tenant) {
            tenant.waiting -= lane.waiting;
            tenant.lanes.retain(|&other| other != id);
        }
        // A tenant ahead of one that waits keeps its pass, so that short uploads cannot reset it.
        let behind = self.smallest_waiting_pass();
        self.tenants
            .retain(|_, tenant| !tenant.lanes.is_empty() || behind.is_some_and(|smallest| tenant.pass > smallest));
    }

    pub(super) fn pushed(&mut self, id: u64, now: Instant) {
        let behind = self.smallest_waiting_pass();
        let Some(lane) = self.lanes.get_mut(&id) else { return };
        if lane.waiting == 0 {
            lane.oldest = now;
        }
        lane.waiting += 1;
        self.waiting += 1;
        // A tenant that was idle starts at the smallest pass of the waiting tenants, or at the virtual time if none waits: idle time earns
        // no credit.
        if let Some(tenant) = self.tenants.get_mut(&lane.tenant) {
            if tenant.waiting == 0 {
                tenant.pass = tenant.pass.max(behind.unwrap_or(self.time));
            }
            tenant.waiting += 1;
        }
    }

    fn smallest_waiting_pass(&self) -> Option<f64> {
        self.tenants.values().filter(|tenant| tenant.waiting > 0).map(|tenant| tenant.pass).reduce(f64::min)
    }

    /// Runs a lane's batches one at a time.
    pub(super) fn keep_order(&mut self, id: u64) {
        if let Some(lane) = self.lanes.get_mut(&id) {
            lane.in_order = true;
        }
    }

    pub(super) fn expect_more(&mut self, id: u64, more: bool) {
        if let Some(lane) = self.lanes.get_mut(&id) {
            lane.more = more;
        }
    }

    pub(super) fn finished(&mut self, id: u64, now: Instant) {
        self.running -= 1;
        if let Some(lane) = self.lanes.get_mut(&id) {
            lane.running -= 1;
            lane.last_finished = Some(now);
        }
    }

    pub(super) fn waiting(&self) -> usize {
        self.waiting
    }

    pub(super) fn stop(&mut self) {
        self.stopped = true;
    }

    pub(super) fn next(&mut self, now: Instant, most: usize) -> Next<W> {
        if self.stopped {
            return Next::Stopped;
        }
        if self.running >= self.slots || self.waiting == 0 {
            return Next::Wait(None);
        }
        let mut soonest: Option<Duration> = None;
        let mut best: Option<(f64, u64, u64)> = None;
        for tenant in self.tenants.values().filter(|t| t.waiting > 0) {
            for &id in &tenant.lanes {
                let lane = &self.lanes[&id];
                match lane.time_until_ready(now, most) {
                    None => {}
                    Some(Duration::ZERO) => {
                        let place = (tenant.pass, lane.served, id);
                        if best.is_none_or(|b| place < b) {
                            best = Some(place);
                        }
                    }
                    Some(time) => soonest = Some(soonest.map_or(time, |s| s.min(time))),
                }
            }
        }
        let Some((_, _, id)) = best else { return Next::Wait(soonest) };
        let lane = self.lanes.get_mut(&id).expect("it was just found");
        let count = lane.waiting.min(most);
        lane.waiting -= count;
        lane.running += 1;
        lane.oldest = now;
        self.running += 1;
        self.waiting -= count;
        let tenant = self.tenants.get_mut(&lane.tenant).expect("a lane's tenant is there");
        tenant.waiting -= count;
        tenant.turn += 1;
        tenant.pass += lane.cost * count as f64 / tenant.weight;
        self.time = self.time.max(tenant.pass);
        lane.served = tenant.turn;
        Next::Batch { lane: id, count, work: lane.work.clone() }
    }
}

impl<W> LaneState<W> {
    /// Time until a batch should start, zero for now; `None` if something has to change first.
    fn time_until_ready(&self, now: Instant, most: usize) -> Option<Duration> {
        if self.waiting == 0 || (self.in_order && self.running > 0) {
            return None;
        }
        if self.waiting >= most {
            return Some(Duration::ZERO);
        }
        if self.running > 0 {
            return None;
        }
        let busy = self.last_finished.is_some_and(|then| now.saturating_duration_since(then) < BUSY_WINDOW);
        if !(self.more && busy) {
            return Some(Duration::ZERO);
        }
        Some(BATCH_DELAY.saturating_sub(now.saturating_duration_since(self.oldest)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn serve(schedule: &mut Schedule<&'static str>, now: Instant, rounds: usize) -> Vec<&'static str> {
        (0..rounds)
            .filter_map(|_| match schedule.next(now, 16) {
                Next::Batch { lane, work, .. } => {
                    schedule.finished(lane, now);
                    Some(work)
                }
                _ => None,
            })
            .collect()
    }

    #[test]
    fn a_tenant_with_many_sessions_gets_no_more_than_one_with_few() {
        let now = Instant::now();
        let mut schedule = Schedule::new(1);
        let many: Vec<u64> = (0..9).map(|_| schedule.add("many", 1.0, 1.0, "many")).collect();
        let few = schedule.add("few", 1.0, 1.0, "few");
        for _ in 0..160 {
            many.iter().chain([&few]).for_each(|&lane| schedule.pushed(lane, now));
        }
        let served = serve(&mut schedule, now, 20);
        assert_eq!(served.iter().filter(|&&w| w == "few").count(), 10);
    }

    #[test]
    fn a_weight_of_three_gets_three_times_as_much() {
        let now = Instant::now();
        let mut schedule = Schedule::new(1);
        let (low, high) = (schedule.add("low", 1.0, 1.0, "low"), schedule.add("high", 3.0, 1.0, "high"));
        for _ in 0..1600 {
            schedule.pushed(low, now);
            schedule.pushed(high, now);
        }
        let served = serve(&mut schedule, now, 80);
        assert_eq!(served.iter().filter(|&&w| w == "high").count(), 60);
    }

    #[test]
    fn the_sessions_of_a_tenant_take_turns() {
        let now = Instant::now();
        let mut schedule = Schedule::new(1);
        let lanes = ["a", "b", "c"].map(|name| schedule.add("tenant", 1.0, 1.0, name));
        for _ in 0..64 {
            lanes.iter().for_each(|&lane| schedule.pushed(lane, now));
        }
        assert_eq!(serve(&mut schedule, now, 6), ["a", "b", "c", "a", "b", "c"]);
    }

    #[test]
    fn a_tenant_that_was_away_does_not_claim_the_time_it_missed() {
        let now = Instant::now();
        let mut schedule = Schedule::new(1);
        let (busy, late) = (schedule.add("busy", 1.0, 1.0, "busy"), schedule.add("late", 1.0, 1.0, "late"));
        (0..1600).for_each(|_| schedule.pushed(busy, now));
        serve(&mut schedule, now, 50);
        (0..1600).for_each(|_| schedule.pushed(late, now));
        let served = serve(&mut schedule, now, 20);
        assert_eq!(served.iter().filter(|&&w| w == "busy").count(), 10);
    }

    #[test]
    fn a_tenant_that_closes_its_lane_after_each_batch_gets_no_more_than_others() {
        let now = Instant::now();
        let mut schedule = Schedule::new(1);
        let steady = schedule.add("steady", 1.0, 1.0, "steady");
        (0..3200).for_each(|_| schedule.pushed(steady, now));
        let mut batches = 0;
        for _ in 0..40 {
            let brief = schedule.add("brief", 1.0, 1.0, "brief");
            (0..16).for_each(|_| schedule.pushed(brief, now));
            while serve(&mut schedule, now, 1) != ["brief"] {
                batches += 1;
            }
            schedule.remove(brief);
        }
        assert!((38..=42).contains(&batches), "{batches} batches of the steady tenant beside 40");
    }

    #[test]
    fn a_tenant_that_was_served_alone_does_not_pay_for_it_later() {
        let now = Instant::now();
        let mut schedule = Schedule::new(1);
        let (old, new) = (schedule.add("old", 1.0, 1.0, "old"), schedule.add("new", 1.0, 1.0, "new"));
        (0..1600).for_each(|_| schedule.pushed(old, now));
        serve(&mut schedule, now, 100);
        // For a moment nobody waits.
        (0..1600).for_each(|_| schedule.pushed(new, now));
        (0..1600).for_each(|_| schedule.pushed(old, now));
        let served = serve(&mut schedule, now, 20);
        let count = served.iter().filter(|&&w| w == "old").count();
        assert!((9..=11).contains(&count), "{served:?}");
    }

    #[test]
    fn the_first_frame_starts_at_once_and_the_next_wait_for_company() {
        let now = Instant::now();
        let mut schedule = Schedule::new(2);
        let lane = schedule.add("t", 1.0, 1.0, "t");
        schedule.expect_more(lane, true);
        schedule.pushed(lane, now);
        assert!(matches!(schedule.next(now, 16), Next::Batch { count: 1, .. }));
        schedule.pushed(lane, now);
        assert!(matches!(schedule.next(now, 16), Next::Wait(None)), "one part of a batch at a time");
        schedule.finished(lane, now);
        assert!(matches!(schedule.next(now, 16), Next::Wait(Some(_))));
        assert!(matches!(schedule.next(now + BATCH_DELAY, 16), Next::Batch { count: 1, .. }));
        schedule.finished(lane, now);
        schedule.pushed(lane, now);
        schedule.expect_more(lane, false);
        assert!(matches!(schedule.next(now, 16), Next::Batch { count: 1, .. }), "the last are not held back");
    }

    #[test]
    fn a_lane_in_order_runs_one_batch_at_a_time() {
        let now = Instant::now();
        let mut schedule = Schedule::new(4);
        let lane = schedule.add("t", 1.0, 1.0, "t");
        schedule.keep_order(lane);
        (0..64).for_each(|_| schedule.pushed(lane, now));
        assert!(matches!(schedule.next(now, 16), Next::Batch { count: 16, .. }));
        assert!(matches!(schedule.next(now, 16), Next::Wait(None)));
        schedule.finished(lane, now);
        assert!(matches!(schedule.next(now, 16), Next::Batch { count: 16, .. }));
    }

    #[test]
    fn no_more_batches_run_than_there_are_slots() {
        let now = Instant::now();
        let mut schedule = Schedule::new(2);
        let lane = schedule.add("t", 1.0, 1.0, "t");
        (0..64).for_each(|_| schedule.pushed(lane, now));
        assert!(matches!(schedule.next(now, 16), Next::Batch { .. }));
        assert!(matches!(schedule.next(now, 16), Next::Batch { .. }));
        assert!(matches!(schedule.next(now, 16), Next::Wait(None)));
    }
}
