//! Places for what may run a few at a time, given to tenants in turn.

use super::lock;
use std::collections::{BTreeMap, VecDeque};
use std::sync::{Arc, Mutex};
use tokio::sync::oneshot;

/// A number of places. Where more want one than there are, the tenant that holds the fewest comes next; among equals, the one that
/// got one longest ago. A tenant's own wishes are met in order.
pub(crate) struct Places {
    inner: Mutex<Inner>,
}

#[derive(Default)]
struct Inner {
    free: usize,
    clock: u64,
    tenants: BTreeMap<String, Tenant>,
}

#[derive(Default)]
struct Tenant {
    holds: usize,
    served: u64,
    waiting: VecDeque<oneshot::Sender<Place>>,
}

/// A place; free again when dropped.
pub(crate) struct Place {
    places: Arc<Places>,
    tenant: String,
}

impl Places {
    pub(crate) fn new(count: usize) -> Arc<Self> {
        Arc::new(Self { inner: Mutex::new(Inner { free: count, ..Inner::default() }) })
    }

    /// Waits for a place. Who stops waiting gives up its turn.
    pub(crate) async fn take(self: &Arc<Self>, tenant: &str) -> Place {
        loop {
            let (give, turn) = oneshot::channel();
            lock(&self.inner).tenants.entry(tenant.to_owned()).or_default().waiting.push_back(give);
            self.hand_out();
            // Nobody drops the sender of who still waits.
            if let Ok(place) = turn.await {
                return place;
            }
        }
    }

    fn hand_out(self: &Arc<Self>) {
        loop {
            // Outside the lock: a place that nobody takes comes back at once.
            let (give, place) = {
                let mut inner = lock(&self.inner);
                let Some(next) = inner.next() else { return };
                next.with(self)
            };
            drop(give.send(place));
        }
    }
}

/// Who comes next.
struct Turn {
    tenant: String,
    give: oneshot::Sender<Place>,
}

impl Turn {
    fn with(self, places: &Arc<Places>) -> (oneshot::Sender<Place>, Place) {
        (self.give, Place { places: Arc::clone(places), tenant: self.tenant })
    }
}

impl Inner {
    fn next(&mut self) -> Option<Turn> {
        if self.free == 0 {
            return None;
        }
        for tenant in self.tenants.values_mut() {
            tenant.waiting.retain(|give| !give.is_closed());
        }
        // Who wants nothing is forgotten, and with it when it was last served: it has waited long enough to come first.
        self.tenants.retain(|_, tenant| tenant.holds > 0 || !tenant.waiting.is_empty());
        let waiting = self.tenants.iter_mut().filter(|(_, tenant)| !tenant.waiting.is_empty());
        let (name, tenant) = waiting.min_by_key(|(_, tenant)| (tenant.holds, tenant.served))?;
        let give = tenant.waiting.pop_front()?;
        self.clock += 1;
        tenant.holds += 1;
        tenant.served = self.clock;
        self.free -= 1;
        Some(Turn { tenant: name.clone(), give })
    }
}

impl Drop for Place {
    fn drop(&mut self) {
        {
            let mut inner = lock(&self.places.inner);
            inner.free += 1;
            if let Some(tenant) = inner.tenants.get_mut(&self.tenant) {
                tenant.holds -= 1;
            }
        }
        self.places.hand_out();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Duration;

    #[tokio::test]
    async fn a_tenant_with_a_long_queue_does_not_hold_up_another() {
        let places = Places::new(1);
        let first = places.take("loud").await;
        let order = Arc::new(Mutex::new(Vec::new()));
        let mut waiting = Vec::new();
        for (tenant, number) in [("loud", 0), ("loud", 1), ("loud", 2), ("quiet", 3), ("other", 4)] {
            let (places, order) = (Arc::clone(&places), Arc::clone(&order));
            waiting.push(tokio::spawn(async move {
                let _place = places.take(tenant).await;
                lock(&order).push(number);
            }));
            tokio::task::yield_now().await;
        }
        drop(first);
        for task in waiting {
            task.await.unwrap();
        }
        // Both come before the loud one's second; which of them is first does not matter.
        let order = lock(&order).clone();
        assert_eq!(order[..2].iter().sum::<i32>(), 7, "{order:?}");
        assert_eq!(order[2..], [0, 1, 2]);
    }

    #[tokio::test]
    async fn who_stops_waiting_takes_no_place() {
        let places = Places::new(1);
        let first = places.take("a").await;
        let waited = tokio::time::timeout(Duration::from_millis(5), places.take("b")).await;
        assert!(waited.is_err());
        drop(first);
        let _place = tokio::time::timeout(Duration::from_secs(5), places.take("a")).await.expect("a free place");
        assert!(tokio::time::timeout(Duration::from_millis(5), places.take("b")).await.is_err());
    }

    #[tokio::test]
    async fn places_run_out_and_come_back() {
        let places = Places::new(2);
        let (a, _b) = (places.take("a").await, places.take("a").await);
        assert!(tokio::time::timeout(Duration::from_millis(5), places.take("a")).await.is_err());
        drop(a);
        let _c = tokio::time::timeout(Duration::from_secs(5), places.take("a")).await.expect("a free place");
    }
}
