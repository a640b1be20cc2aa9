//! The other ends of a vertex's open edges, in the order in which they were opened.

use std::collections::{BTreeMap, HashMap};

/// Most ends in a plain list: a hub may have as many as the mesh has edges.
const FEW: usize = 128;
/// Ends that are looked at where the walk asks what lies near.
pub(crate) const NEWEST: usize = 16;

/// The open edges of a vertex; of several to the same end the newest is removed first.
pub(crate) enum OpenEdges {
    Few(Vec<u32>),
    Many(Box<Indexed>),
}

/// Ends by when they were opened, and these times by end.
#[derive(Default)]
pub(crate) struct Indexed {
    ends: BTreeMap<usize, u32>,
    times: HashMap<u32, Vec<usize>>,
    opened: usize,
}

impl Default for OpenEdges {
    fn default() -> Self {
        Self::Few(Vec::new())
    }
}

impl OpenEdges {
    pub(crate) fn contains(&self, end: u32) -> bool {
        match self {
            Self::Few(list) => list.contains(&end),
            Self::Many(indexed) => indexed.times.contains_key(&end),
        }
    }

    pub(crate) fn push(&mut self, end: u32) {
        match self {
            Self::Few(list) if list.len() < FEW => list.push(end),
            Self::Few(list) => {
                let mut indexed = Box::<Indexed>::default();
                list.iter().chain([&end]).for_each(|&end| indexed.push(end));
                *self = Self::Many(indexed);
            }
            Self::Many(indexed) => indexed.push(end),
        }
    }

    /// Removes the newest edge to this end; false where there is none.
    pub(crate) fn remove(&mut self, end: u32) -> bool {
        match self {
            Self::Few(list) => list.iter().rposition(|&x| x == end).map(|at| list.remove(at)).is_some(),
            Self::Many(indexed) => indexed.remove(end),
        }
    }

    /// The last ones, the oldest first; `scratch` holds them where they are not side by side.
    pub(crate) fn newest<'a>(&'a self, scratch: &'a mut [u32; NEWEST]) -> &'a [u32] {
        match self {
            Self::Few(list) => &list[list.len().saturating_sub(NEWEST)..],
            Self::Many(indexed) => {
                let first = NEWEST - indexed.ends.len().min(NEWEST);
                scratch[first..].iter_mut().rev().zip(indexed.ends.values().rev()).for_each(|(to, &end)| *to = end);
                &scratch[first..]
            }
        }
    }
}

impl Indexed {
    fn push(&mut self, end: u32) {
        self.ends.insert(self.opened, end);
        self.times.entry(end).or_default().push(self.opened);
        self.opened += 1;
    }

    fn remove(&mut self, end: u32) -> bool {
        let Some(times) = self.times.get_mut(&end) else { return false };
        if let Some(time) = times.pop() {
            self.ends.remove(&time);
        }
        if times.is_empty() {
            self.times.remove(&end);
        }
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_long_list_does_what_a_short_one_does() {
        let mut random = fastrand::Rng::with_seed(4);
        let mut plain: Vec<u32> = Vec::new();
        let mut edges = OpenEdges::default();
        for step in 0..4_000 {
            let end = random.u32(..200);
            // Grows to many more than a plain list holds, then shrinks.
            if random.u32(..4) < if step < 2_000 { 3 } else { 1 } {
                plain.push(end);
                edges.push(end);
            } else {
                let place = plain.iter().rposition(|&x| x == end);
                place.map(|place| plain.remove(place));
                assert_eq!(edges.remove(end), place.is_some());
            }
            assert_eq!(edges.newest(&mut [0; NEWEST]), &plain[plain.len().saturating_sub(NEWEST)..]);
            assert_eq!(edges.contains(end), plain.contains(&end));
        }
        assert!(matches!(edges, OpenEdges::Many(_)));
    }
}
