//! What the walk over a mesh calls the vertices that it meets for the first time.

use crate::entropy::{Coder, Integers, SIZES, size_class};
use crate::fenwick::Counted;

/// The turn of vertices that were not met yet.
pub(crate) const UNMET: u32 = u32::MAX;

/// What vertices are called that are met for the first time.
pub(crate) enum Names {
    /// What the faces call them that are encoded; the faces at each.
    Given(Vec<u32>),
    /// By their turn.
    Turns,
    /// By the numbers of the mesh, which are read where they are met.
    Numbers(Box<Numbers>),
}

/// Reads the numbers of vertices where they are met, by how many others that are not met yet lie between one and one that was: [`crate::mesh::MeshVersion::First`].
pub(crate) struct Numbers {
    models: Integers,
    unmet: Counted,
    before: u32,
}

impl Numbers {
    pub(crate) fn new(points: usize) -> Self {
        Self { models: Integers::new(SIZES), unmet: Counted::all(points), before: 0 }
    }

    /// The number of the next new vertex, met beside `near`; [`UNMET`] where no vertex has what was read.
    pub(crate) fn read(&mut self, coder: &mut impl Coder, near: u32) -> u32 {
        let expected = self.unmet.before(near);
        let context = size_class(self.before.min(1 << 16) * 2);
        let difference = self.models.code(coder, context, 0);
        self.before = (self.before + difference.unsigned_abs().min(1 << 20)) / 2;
        let Some(vertex) = self.unmet.find(expected.wrapping_add(difference as u32)) else { return UNMET };
        self.unmet.remove(vertex);
        vertex
    }
}
