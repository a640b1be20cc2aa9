//! What decoding coded groups needs.

use super::section::Entry;
use cager_codec::{CageBasis, Hierarchy, Residual};

/// What decoding groups needs, computed where the first is read.
#[derive(Default)]
pub(super) struct Groups {
    /// Unrotated and rotated, as each group says which it has.
    pub(super) bases: [Option<CageBasis>; 2],
    pub(super) hierarchy: Option<Hierarchy>,
    /// The residuals decoded last, each with the entry that it was read from.
    pub(super) residuals: Vec<(Entry, Residual)>,
}
