//! Edges at which the walk over a mesh goes on.

use std::collections::VecDeque;

/// Open edges are told apart by the faces to come at their ends up to this number.
pub(crate) const MAX_TO_COME: u32 = 15;

/// Edges at which the walk may go on, by how few faces are to come at an end, then by age.
#[derive(Default)]
pub(crate) struct Gates([VecDeque<(u32, u32)>; MAX_TO_COME as usize + 1]);

impl Gates {
    pub(crate) fn push(&mut self, gate: (u32, u32), to_come: u32) {
        self.0[to_come.min(MAX_TO_COME) as usize].push_back(gate);
    }

    pub(crate) fn pop(&mut self) -> Option<(u32, u32)> {
        self.0.iter_mut().find_map(VecDeque::pop_front)
    }
}
