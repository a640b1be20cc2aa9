//! What decoding coded groups needs.

use super::section::Entry;
use cager_codec::{BasisRecord, CageBasis, Hierarchy, Residual};

/// Bases that are computed for one file; writers have one, and it takes long.
const MAX_BASES: usize = 8;

/// What decoding groups needs, computed where the first is read.
#[derive(Default)]
pub(super) struct Groups {
    /// Those that groups say they have, two at the most.
    bases: Vec<CageBasis>,
    /// How many were begun to be computed, also in vain.
    begun: usize,
    pub(super) hierarchy: Option<Hierarchy>,
    /// The residuals decoded last, each with the entry that it was read from.
    pub(super) residuals: Vec<(Entry, Residual)>,
}

impl Groups {
    pub(super) fn basis(&self, record: &BasisRecord) -> Option<&CageBasis> {
        self.bases.iter().find(|basis| basis.record() == record)
    }

    /// Whether a file may have one more basis, which is to be computed now beside one that is kept.
    pub(super) fn may_begin(&mut self) -> bool {
        self.bases.truncate(1);
        self.begun += 1;
        self.begun <= MAX_BASES
    }

    pub(super) fn keep_basis(&mut self, basis: CageBasis) {
        self.bases.retain(|other| other.record() != basis.record());
        self.bases.truncate(1);
        self.bases.insert(0, basis);
    }
}
