//! Admission control: budgets shared by tenants, for memory, disk space, requests, streams and preparations, each in its own unit.
//!
//! A tenant may hold at most twice the free remainder (the dynamic thresholds of Choudhury and Hahne 1998 with α = 2): a single active
//! tenant gets two thirds, a second one beside it two ninths, so that something is left for further tenants. A budget that is not shared
//! has no such limit.

use crate::problem::{self, ApiError};
use crate::sync::lock;
use std::collections::{BTreeMap, VecDeque};
use std::sync::{Arc, Mutex};
use tokio::sync::oneshot;

impl Exhausted {
    /// The response to a refused request for `what`: 429 if the tenant has its share, 503 if others hold the rest.
    pub(crate) fn refusal(self, what: &str) -> ApiError {
        match self {
            Self::OverShare => {
                let detail = format!("you hold your share of the {what}; wait for what you have begun, then try again");
                ApiError::new(problem::SHARE_TAKEN, detail).retry_after(2)
            }
            Self::Full => {
                let detail = format!("all of the {what} is taken at the moment; try again later");
                ApiError::new(problem::BUSY, detail).retry_after(2)
            }
        }
    }
}

/// A limited amount of a resource, shared by all tenants.
pub(crate) struct Budget {
    total: u64,
    /// Whether several tenants are possible.
    shared: bool,
    ledger: Mutex<Ledger>,
}

#[derive(Default)]
struct Ledger {
    used: u64,
    clock: u64,
    tenants: BTreeMap<String, Account>,
}

#[derive(Default)]
struct Account {
    holds: u64,
    served: u64,
    waiting: VecDeque<(u64, oneshot::Sender<Permit>)>,
}

/// An amount of a budget, released on drop.
pub(crate) struct Permit {
    budget: Arc<Budget>,
    tenant: String,
    amount: u64,
}

/// Why a budget refuses.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Exhausted {
    /// The tenant has its share.
    OverShare,
    /// Nothing is left of the budget.
    Full,
}

impl Budget {
    /// A budget of `total`; `shared` if several tenants are possible.
    pub(crate) fn new(total: u64, shared: bool) -> Arc<Self> {
        Arc::new(Self { total: total.max(1), shared, ledger: Mutex::default() })
    }

    /// The most that one tenant can hold: nobody gets everything of what is shared.
    pub(crate) fn most(&self) -> u64 {
        if self.shared { (self.total - self.total.div_ceil(3)).max(1) } else { self.total }
    }

    /// Takes `amount` without waiting. An amount above [`Self::most`] is reduced to it.
    pub(crate) fn try_take(self: &Arc<Self>, tenant: &str, amount: u64) -> Result<Permit, Exhausted> {
        let amount = amount.min(self.most());
        let mut ledger = lock(&self.ledger);
        let holds = ledger.tenants.get(tenant).map_or(0, |account| account.holds);
        if self.admits(ledger.used, holds, amount) {
            return Ok(ledger.hold(self, tenant, amount));
        }
        // Would it fit if no other tenant held anything?
        let is_own_share = self.shared && !self.admits(holds, holds, amount);
        Err(if is_own_share { Exhausted::OverShare } else { Exhausted::Full })
    }

    /// Waits for `amount`, reduced as by [`Self::try_take`]. Among waiting tenants the one with the smallest amount is served first, then the one served longest ago;
    /// requests of one tenant are served in order. Dropping the future leaves the queue.
    pub(crate) async fn take(self: &Arc<Self>, tenant: &str, amount: u64) -> Permit {
        loop {
            let (give, turn) = oneshot::channel();
            let request = (amount.min(self.most()), give);
            lock(&self.ledger).tenants.entry(tenant.to_owned()).or_default().waiting.push_back(request);
            self.serve_waiters();
            // The sender is dropped only together with its receiver.
            if let Ok(held) = turn.await {
                return held;
            }
        }
    }

    /// Tenants that hold or wait for some of it.
    pub(crate) fn tenants(&self) -> Vec<String> {
        lock(&self.ledger).tenants.keys().cloned().collect()
    }

    /// The tenant that holds most.
    pub(crate) fn largest_holder(&self) -> Option<String> {
        let ledger = lock(&self.ledger);
        ledger.tenants.iter().max_by_key(|(_, account)| account.holds).map(|(tenant, _)| tenant.clone())
    }

    /// The amount that a tenant holds.
    pub(crate) fn held_by(&self, tenant: &str) -> u64 {
        lock(&self.ledger).tenants.get(tenant).map_or(0, |account| account.holds)
    }

    /// The amount in use.
    pub(crate) fn used(&self) -> u64 {
        lock(&self.ledger).used
    }

    fn admits(&self, used: u64, holds: u64, amount: u64) -> bool {
        let Some(free) = self.total.checked_sub(used + amount) else { return false };
        !self.shared || holds == 0 || holds + amount <= 2 * free
    }

    fn serve_waiters(self: &Arc<Self>) {
        loop {
            // Sent outside the lock: if the receiver is gone, dropping the permit locks again.
            let (give, held) = {
                let mut ledger = lock(&self.ledger);
                let Some((tenant, amount, give)) = ledger.next(self) else { return };
                (give, ledger.hold(self, &tenant, amount))
            };
            drop(give.send(held));
        }
    }
}

impl Permit {
    /// Whose it is.
    pub(crate) fn tenant(&self) -> &str {
        &self.tenant
    }

    /// Takes `by` more without waiting.
    pub(crate) fn grow(&mut self, by: u64) -> Result<(), Exhausted> {
        let mut more = self.budget.try_take(&self.tenant, by)?;
        // Merged into one permit.
        self.amount += std::mem::take(&mut more.amount);
        Ok(())
    }

    /// Grows to at least `amount`, in multiples of `piece`.
    pub(crate) fn grow_to(&mut self, amount: u64, piece: u64) -> Result<(), Exhausted> {
        match amount.saturating_sub(self.amount) {
            0 => Ok(()),
            missing => self.grow(missing.next_multiple_of(piece)),
        }
    }

    /// A permit of amount 0, to be grown later.
    pub(crate) fn empty(budget: &Arc<Budget>, tenant: &str) -> Self {
        lock(&budget.ledger).hold(budget, tenant, 0)
    }

    /// All of it; what is left is empty.
    pub(crate) fn take(&mut self) -> Self {
        let empty = Self::empty(&self.budget, &self.tenant);
        std::mem::replace(self, empty)
    }
}

impl Ledger {
    fn hold(&mut self, budget: &Arc<Budget>, tenant: &str, amount: u64) -> Permit {
        self.clock += 1;
        self.used += amount;
        let account = self.tenants.entry(tenant.to_owned()).or_default();
        account.holds += amount;
        account.served = self.clock;
        Permit { budget: Arc::clone(budget), tenant: tenant.to_owned(), amount }
    }

    /// The next request that can be served.
    fn next(&mut self, budget: &Budget) -> Option<(String, u64, oneshot::Sender<Permit>)> {
        for account in self.tenants.values_mut() {
            account.waiting.retain(|(_, give)| !give.is_closed());
        }
        // Idle tenants are forgotten, with the time of their last service: they come first when they return.
        self.tenants.retain(|_, account| account.holds > 0 || !account.waiting.is_empty());
        let used = self.used;
        let may = |account: &Account| {
            account.waiting.front().is_some_and(|&(amount, _)| budget.admits(used, account.holds, amount))
        };
        let waiting = self.tenants.iter_mut().filter(|(_, account)| may(account));
        let (tenant, account) = waiting.min_by_key(|(_, account)| (account.holds, account.served))?;
        let (amount, give) = account.waiting.pop_front()?;
        Some((tenant.clone(), amount, give))
    }
}

impl Drop for Permit {
    fn drop(&mut self) {
        {
            let mut ledger = lock(&self.budget.ledger);
            ledger.used -= self.amount;
            if let Some(account) = ledger.tenants.get_mut(&self.tenant) {
                account.holds -= self.amount;
                if account.holds == 0 && account.waiting.is_empty() {
                    ledger.tenants.remove(&self.tenant);
                }
            }
        }
        self.budget.serve_waiters();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Duration;

    /// Whether a request is not met for a while.
    async fn waits(budget: &Arc<Budget>, tenant: &str, amount: u64) -> bool {
        tokio::time::timeout(Duration::from_millis(5), budget.take(tenant, amount)).await.is_err()
    }

    #[tokio::test]
    async fn one_tenant_of_several_never_gets_everything() {
        let budget = Budget::new(900, true);
        let loud: Vec<Permit> = std::iter::from_fn(|| budget.try_take("loud", 1).ok()).collect();
        assert_eq!(loud.len(), 600);
        assert_eq!(budget.try_take("loud", 1).err(), Some(Exhausted::OverShare));
        assert!(waits(&budget, "loud", 1).await);
        let quiet: Vec<Permit> = std::iter::from_fn(|| budget.try_take("quiet", 1).ok()).collect();
        assert_eq!(quiet.len(), 200);
        let all = budget.try_take("other", 300).err();
        assert_eq!((all, budget.used()), (Some(Exhausted::Full), 800));
        drop((loud, quiet));
        assert_eq!(budget.used(), 0);
        assert!(lock(&budget.ledger).tenants.is_empty());
    }

    #[tokio::test]
    async fn a_tenant_alone_gets_everything_and_what_is_larger_takes_everything() {
        let budget = Budget::new(10, false);
        let held = budget.try_take("a", 7).expect("room");
        assert_eq!(budget.try_take("a", 4).err(), Some(Exhausted::Full));
        let rest = budget.try_take("a", 3).expect("room");
        assert!(waits(&budget, "b", 1).await);
        drop((held, rest));
        let all = budget.take("a", 1000).await;
        assert_eq!(budget.used(), 10);
        drop(all);
    }

    #[tokio::test]
    async fn a_tenant_that_holds_nothing_gets_no_more_than_one_that_does() {
        let budget = Budget::new(900, true);
        let large = budget.try_take("large", 1000).expect("room");
        assert_eq!((large.amount, budget.most()), (600, 600));
        let small = budget.try_take("small", 200).expect("what is left is for others");
        let next = tokio::time::timeout(Duration::from_millis(5), budget.take("next", 1000)).await;
        assert!(next.is_err(), "it waits for the others");
        drop((large, small));
        assert_eq!(budget.take("next", 1000).await.amount, 600);
        assert_eq!([1, 2, 3, 4].map(|total| Budget::new(total, true).most()), [1, 1, 2, 2]);
    }

    #[tokio::test]
    async fn a_tenant_with_a_long_queue_does_not_hold_up_another() {
        let budget = Budget::new(1, true);
        let first = budget.take("loud", 1).await;
        let order = Arc::new(Mutex::new(Vec::new()));
        let mut waiting = Vec::new();
        for (tenant, number) in [("loud", 0), ("loud", 1), ("loud", 2), ("quiet", 3), ("other", 4)] {
            let (budget, order) = (Arc::clone(&budget), Arc::clone(&order));
            waiting.push(tokio::spawn(async move {
                let _place = budget.take(tenant, 1).await;
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
    async fn who_stops_waiting_takes_nothing() {
        let budget = Budget::new(1, true);
        let first = budget.take("a", 1).await;
        assert!(waits(&budget, "b", 1).await);
        drop(first);
        let _place = tokio::time::timeout(Duration::from_secs(5), budget.take("a", 1)).await.expect("room");
        assert!(waits(&budget, "b", 1).await);
    }

    #[tokio::test]
    async fn one_of_two_places_is_left_to_others() {
        let budget = Budget::new(2, true);
        let one = budget.take("a", 1).await;
        assert!(waits(&budget, "a", 1).await);
        let other = tokio::time::timeout(Duration::from_secs(5), budget.take("b", 1)).await.expect("room");
        drop(one);
        let _again = tokio::time::timeout(Duration::from_secs(5), budget.take("a", 1)).await.expect("room");
        drop(other);
    }
}
