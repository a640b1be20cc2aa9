//! Groups that are coded only because a session is being completed: they stay with its completion, or not at all.

use super::Session;
use super::groups::{GroupOnDisk, LastGroup};
use crate::sync::lock;
use std::sync::atomic::Ordering::Relaxed;

impl Session {
    /// As [`Self::coded_group`], with the groups of a completion that is going on.
    pub(crate) fn group_to_write(&self, frame: u32) -> Option<GroupOnDisk> {
        let groups = lock(&self.groups);
        groups.of(frame).or_else(|| {
            let mut last = groups.last.iter().map(|last| last.group);
            last.find(|group| (group.first..group.first + group.frames).contains(&frame))
        })
    }

    /// Takes over the groups of a completion that has come about.
    pub(super) fn keep_last_groups(&self) {
        let last = std::mem::take(&mut lock(&self.groups).last);
        for LastGroup { group, errors, carried } in last {
            self.frames().set_errors(group.first, &errors);
            self.count_coded(errors.len());
            let mut groups = lock(&self.groups);
            groups.failed = None;
            groups.coded.push(group);
            groups.carried = carried;
        }
    }

    /// Forgets the groups of a completion that has failed. Blocks.
    pub(super) fn drop_last_groups(&self) {
        let last = std::mem::take(&mut lock(&self.groups).last);
        if last.is_empty() {
            return;
        }
        match self.store.remove_last_groups(&self.meta.id) {
            Ok(()) => drop(self.bytes.fetch_sub(last.iter().map(|last| last.group.bytes).sum(), Relaxed)),
            // They are replaced, or removed at the next start.
            Err(error) => tracing::warn!(session = %self.meta.id, %error, "groups of a failed completion take space"),
        }
    }
}
