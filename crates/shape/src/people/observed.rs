//! What a person was seen as.

use crate::registration::{Observation, OrientedPoints};

/// An observation, ready to be matched.
pub(super) struct Observed<'a> {
    pub(super) observation: &'a Observation,
    pub(super) tree: OrientedPoints,
    /// Those of its points that are matched with the template.
    pub(super) chosen: Vec<usize>,
}
