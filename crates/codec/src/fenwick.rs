//! A set of numbers that is counted in a Fenwick tree.

/// Numbers below a limit, each in the set or not.
#[derive(Clone)]
pub(crate) struct Counted {
    sums: Vec<u32>,
    count: u32,
}

impl Counted {
    /// None of the numbers below `limit`.
    pub(crate) fn none(limit: usize) -> Self {
        Self { sums: vec![0; limit + 1], count: 0 }
    }

    /// How many are in the set.
    pub(crate) fn count(&self) -> u32 {
        self.count
    }

    /// How many of the set are below this number.
    pub(crate) fn before(&self, number: u32) -> u32 {
        let mut at = (number as usize).min(self.sums.len() - 1);
        let mut count = 0;
        while at > 0 {
            count += self.sums[at];
            at &= at - 1;
        }
        count
    }

    /// The number of the set that has so many of it below; beyond the last there is none.
    pub(crate) fn find(&self, rank: u32) -> Option<u32> {
        if rank >= self.count {
            return None;
        }
        let (mut at, mut rest) = (0, rank);
        let mut reach = self.sums.len().next_power_of_two();
        while reach > 0 {
            if at + reach < self.sums.len() && self.sums[at + reach] <= rest {
                at += reach;
                rest -= self.sums[at];
            }
            reach /= 2;
        }
        Some(at as u32)
    }

    /// Adds a number that is not in the set.
    pub(crate) fn insert(&mut self, number: u32) {
        self.count += 1;
        self.change(number, 1);
    }

    /// Takes a number out that is in the set.
    pub(crate) fn remove(&mut self, number: u32) {
        self.count -= 1;
        self.change(number, u32::MAX);
    }

    fn change(&mut self, number: u32, by: u32) {
        let mut at = number as usize + 1;
        while at < self.sums.len() {
            self.sums[at] = self.sums[at].wrapping_add(by);
            at += at & at.wrapping_neg();
        }
    }
}
