//! Cage jobs of the same input, which have the same cage.

use super::{CageDesign, CageJob};
use crate::jobs::{Jobs, Phase};
use crate::store::ContentKey;
use std::sync::Arc;

impl Jobs<CageDesign> {
    /// A job of the same input: a completed one, or else an unfinished one created before the job `before`.
    pub(super) fn duplicate(&self, tenant: &str, key: &ContentKey, before: Option<&str>) -> Option<Arc<CageJob>> {
        let mut same = self.of(tenant);
        same.retain(|job| job.meta.key == *key);
        let completed = same.iter().find(|job| matches!(job.status().phase, Phase::Completed(_)));
        let earlier = || {
            let is_earlier = |id: &str| before.is_some_and(|before| *id < *before);
            same.iter().find(|job| is_earlier(&job.meta.id) && !job.status().phase.is_final())
        };
        completed.or_else(earlier).cloned()
    }
}
