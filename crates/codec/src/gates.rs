//! Edges at which the walk over a mesh goes on.

use std::collections::VecDeque;

/// Open edges are told apart by the faces to come at their ends up to this number.
pub(crate) const MOST_TO_COME: u32 = 15;

/// Edges at which the walk may go on; some wait no longer.
pub(crate) enum Gates {
    /// By how few faces are to come at one of their ends, which is then complete soon; those that were opened or came nearer first before others.
    Fewest(Vec<VecDeque<(u32, u32)>>),
    /// The newest first.
    Newest(Vec<(u32, u32)>),
    /// The oldest first.
    Oldest(VecDeque<(u32, u32)>),
}

impl Gates {
    pub(crate) fn fewest() -> Self {
        Self::Fewest(vec![VecDeque::new(); MOST_TO_COME as usize + 1])
    }

    pub(crate) fn push(&mut self, gate: (u32, u32), to_come: u32) {
        match self {
            Self::Fewest(queues) => queues[to_come.min(MOST_TO_COME) as usize].push_back(gate),
            Self::Newest(list) => list.push(gate),
            Self::Oldest(queue) => queue.push_back(gate),
        }
    }

    pub(crate) fn pop(&mut self) -> Option<(u32, u32)> {
        match self {
            Self::Fewest(queues) => queues.iter_mut().find_map(VecDeque::pop_front),
            Self::Newest(list) => list.pop(),
            Self::Oldest(queue) => queue.pop_front(),
        }
    }
}
