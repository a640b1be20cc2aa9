//! What a person was seen as.

use cager_registration::{Observation, OrientedPoints};

/// An observation, ready to be matched.
pub(super) struct Observed<'a> {
    pub(super) observation: &'a Observation,
    pub(super) tree: OrientedPoints,
    /// Those of its points that are matched with the template.
    pub(super) chosen: Vec<usize>,
}
