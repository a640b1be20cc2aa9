//! Sets of frame numbers as maximal intervals of consecutive numbers; memory grows with the number of gaps.

use std::collections::BTreeMap;

/// First and last number of each interval, inclusive.
#[derive(Debug, Default)]
pub(crate) struct IntervalSet(BTreeMap<u32, u32>);

/// A page of the ranges missing from a set.
#[derive(Debug, Default, PartialEq, Eq)]
pub(crate) struct Missing {
    /// Ranges `[a, b)`, ascending.
    pub(crate) ranges: Vec<[u32; 2]>,
    /// Where to continue, if the page does not list all of them.
    pub(crate) next: Option<u32>,
}

impl IntervalSet {
    /// Adds a number.
    pub(crate) fn insert(&mut self, number: u32) {
        let before = self.0.range(..=number).next_back().map(|(&first, &last)| (first, last));
        if before.is_some_and(|(_, last)| last >= number) {
            return;
        }
        let first = before.filter(|&(_, last)| last.checked_add(1) == Some(number)).map_or(number, |(first, _)| first);
        let last = number.checked_add(1).and_then(|after| self.0.remove(&after)).unwrap_or(number);
        self.0.insert(first, last);
    }

    /// Removes all numbers from `from` on.
    pub(crate) fn truncate(&mut self, from: u32) {
        self.0.split_off(&from);
        if let Some(mut run) = self.0.last_entry()
            && *run.get() >= from
        {
            // This interval begins before `from`.
            *run.get_mut() = from - 1;
        }
    }

    /// Number of consecutive members from `first` on.
    pub(crate) fn length_from(&self, first: u32) -> u64 {
        let run = self.0.range(..=first).next_back().filter(|&(_, &last)| last >= first);
        run.map_or(0, |(_, &last)| u64::from(last - first) + 1)
    }

    /// At most `most` ranges of `from..end` that are missing.
    pub(crate) fn missing(&self, from: u32, end: u32, most: usize) -> Missing {
        let mut ranges = Vec::new();
        let mut next = u64::from(from) + self.length_from(from);
        // Skip the interval that contains `from`.
        let Ok(begin) = u32::try_from(next) else { return Missing::default() };
        let later = self.0.range(begin..).map(|(&first, &last)| (u64::from(first), u64::from(last) + 1));
        for (first, after) in later.chain([(u64::from(end), u64::from(end))]) {
            let first = first.min(u64::from(end));
            if first > next {
                if ranges.len() == most {
                    return Missing { ranges, next: Some(next as u32) };
                }
                ranges.push([next as u32, first as u32]);
            }
            if after >= u64::from(end) {
                break;
            }
            next = after;
        }
        Missing { ranges, next: None }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    fn plain(set: &BTreeSet<u32>, from: u32, end: u32) -> Vec<[u32; 2]> {
        let mut ranges: Vec<[u32; 2]> = Vec::new();
        for number in (from..end).filter(|number| !set.contains(number)) {
            match ranges.last_mut() {
                Some(range) if range[1] == number => range[1] += 1,
                _ => ranges.push([number, number + 1]),
            }
        }
        ranges
    }

    #[test]
    fn runs_say_what_a_plain_set_says() {
        let mut random = fastrand::Rng::with_seed(7);
        for _ in 0..200 {
            let (mut runs, mut set) = (IntervalSet::default(), BTreeSet::new());
            for _ in 0..random.usize(0..60) {
                let number = random.u32(0..40);
                runs.insert(number);
                set.insert(number);
                if random.u8(0..20) == 0 {
                    let from = random.u32(0..40);
                    runs.truncate(from);
                    set.split_off(&from);
                }
                let (from, end) = (random.u32(0..45), random.u32(0..45));
                let expected = plain(&set, from, end);
                assert_eq!(runs.missing(from, end, usize::MAX), Missing { ranges: expected.clone(), next: None });
                let length = (from..).take_while(|number| set.contains(number)).count() as u64;
                assert_eq!(runs.length_from(from), length);
                // Page by page it is the same.
                let (mut paged, mut next) = (Vec::new(), Some(from));
                while let Some(from) = next {
                    let page = runs.missing(from, end, 2);
                    paged.extend(page.ranges);
                    next = page.next;
                }
                assert_eq!(paged, expected);
            }
        }
    }

    #[test]
    fn the_highest_number_is_no_exception() {
        let mut runs = IntervalSet::default();
        runs.insert(u32::MAX);
        runs.insert(u32::MAX - 1);
        assert_eq!(runs.length_from(u32::MAX - 1), 2);
        assert_eq!(runs.missing(u32::MAX, u32::MAX, 9), Missing::default());
        assert_eq!(runs.missing(5, u32::MAX, 9).ranges, [[5, u32::MAX - 1]]);
    }
}
