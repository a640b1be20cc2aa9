//! What of a session's frames is coded, where they are to meet a goal for error, size or quality: coded groups, and frames that wait on disk until their group
//! is whole.

use super::Session;
use super::facts::Facts;
use crate::problem::{self, ApiError};
use crate::store::{SessionBytes, StoreError};
use crate::sync::lock;
use cager_capture::capture::StoredError;
use cager_capture::coding::{Carried, Goal, group_frames};
use cager_proto::messages::CodedFrames;
use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;
use std::sync::atomic::Ordering::Relaxed;

/// What of a session's frames is coded.
#[derive(Default)]
pub(crate) struct Groups {
    /// From frame 0 on, without gaps.
    pub(super) coded: Vec<GroupOnDisk>,
    pub(super) carried: Carried,
    /// What follows these in the completion that is going on: nothing of it stays if that fails.
    pub(super) last: Vec<LastGroup>,
    /// Why the next group cannot be coded as asked for, and how many frames it has.
    pub(super) failed: Option<(u32, ApiError)>,
    /// Files of frames whose names are durable, by their first frame.
    named: BTreeSet<u32>,
}

/// A group that is coded for a completion: with fewer frames than usual, or for another number of frames than was announced.
pub(super) struct LastGroup {
    pub(super) group: GroupOnDisk,
    pub(super) errors: Vec<StoredError>,
    pub(super) carried: Carried,
}

/// A coded group on disk.
#[derive(Clone, Copy, Debug)]
pub(crate) struct GroupOnDisk {
    pub(crate) first: u32,
    pub(crate) frames: u32,
    pub(super) bytes: u64,
}

/// What the file of a coded group holds.
#[derive(Deserialize, Serialize)]
pub(crate) struct StoredGroup {
    pub(crate) cages: Vec<u8>,
    pub(crate) residual: Option<Vec<u8>>,
    /// Errors of what the frames decode to.
    pub(crate) errors: Vec<StoredError>,
    /// The frame whose cage lies farthest from the origin, and how far.
    pub(crate) farthest: (usize, f64),
    pub(crate) carried: Carried,
}

impl Groups {
    /// Frames that are coded.
    pub(crate) fn frames(&self) -> u32 {
        self.coded.last().map_or(0, |group| group.first + group.frames)
    }

    /// Frames that are coded, those of a completion that is going on included, and what they leave to the next group.
    pub(super) fn end(&self) -> (u32, Carried) {
        match self.last.last() {
            Some(LastGroup { group, carried, .. }) => (group.first + group.frames, *carried),
            None => (self.frames(), self.carried),
        }
    }

    /// The group that a frame belongs to, if it is coded.
    pub(crate) fn of(&self, frame: u32) -> Option<GroupOnDisk> {
        let at = self.coded.partition_point(|group| group.first + group.frames <= frame);
        self.coded.get(at).copied()
    }

    /// Whether all that is here can be read from the store again.
    pub(super) fn are_stored(&self) -> bool {
        self.last.is_empty() && self.failed.is_none()
    }

    pub(super) fn add(&mut self, first: u32, group: &StoredGroup, bytes: u64) {
        self.coded.push(GroupOnDisk { first, frames: group.errors.len() as u32, bytes });
        self.carried = group.carried;
    }
}

impl Session {
    /// What the container is to meet; `None` where frames are stored as they are solved for.
    pub(crate) fn goal(&self) -> Option<Goal> {
        self.goal
    }

    /// Frames that are coded, in sessions whose frames are.
    pub(crate) fn coded_frames(&self) -> Option<u32> {
        self.goal.map(|_| lock(&self.groups).frames())
    }

    /// What of the frames is coded, as the API says it.
    pub(crate) fn coding_view(&self, facts: Option<&Facts>) -> Option<CodedFrames> {
        self.goal?;
        let groups = lock(&self.groups);
        Some(CodedFrames {
            group_frames: facts.map(|facts| group_frames(facts.points as usize, facts.unknowns as usize) as u32),
            frames: groups.frames(),
            bytes: groups.coded.iter().map(|group| group.bytes).sum(),
            problem: groups.failed.as_ref().map(|(_, error)| (*error.problem).clone()),
        })
    }

    /// The coded group that a frame belongs to.
    pub(crate) fn coded_group(&self, frame: u32) -> Option<GroupOnDisk> {
        lock(&self.groups).of(frame)
    }

    /// Reads a coded group. Blocks.
    ///
    /// # Errors
    /// A group that was left out at completion meanwhile; damage, after which the session has failed; I/O errors.
    pub(crate) fn read_group(&self, first: u32) -> Result<StoredGroup, ApiError> {
        let found = self.store.group(&self.meta.id, first, true).map_err(|error| self.fail_if_damaged(error))?;
        match found {
            Some((group, _)) => Ok(group),
            None if self.coded_group(first).is_none() => Err(left_out(first)),
            None => Err(self.fail_if_damaged(self.damaged(format!("group {first} is gone")))),
        }
    }

    /// Refuses frames for groups that cannot be coded.
    ///
    /// # Errors
    /// What completing would answer.
    pub(crate) fn check_coding(&self) -> Result<(), ApiError> {
        lock(&self.groups).failed.as_ref().map_or(Ok(()), |(_, error)| Err(error.clone()))
    }

    /// Finds the coded groups on disk. The stored frames are known already. Blocks.
    pub(super) fn load_groups(&self) -> Result<(), StoreError> {
        if self.goal.is_none() {
            return Ok(());
        }
        let is_marked = match self.store.completion(&self.meta.id) {
            Ok(mark) => mark.is_some(),
            // What belongs to a completion must not be lost with its mark.
            Err(StoreError::Damaged { .. }) => true,
            Err(error) => return Err(error),
        };
        let mut found = Groups::default();
        while self.declared().is_none_or(|declared| found.frames() < declared) {
            let first = found.frames();
            let group = self.store.group::<StoredGroup>(&self.meta.id, first, is_marked)?;
            let Some((group, bytes)) = group else { break };
            if group.errors.is_empty() {
                return Err(self.damaged("a group has no frames"));
            }
            self.frames().set_errors(first, &group.errors);
            found.add(first, &group, bytes);
            // The process may have ended before it did.
            self.remove_coded(first, found.frames())?;
        }
        if let Some(declared) = self.declared() {
            self.store.remove_frames(&self.meta.id, None)?;
            self.store.remove_groups_from(&self.meta.id, declared)?;
        }
        if !is_marked {
            // The process may have ended while the session was being completed.
            self.store.remove_last_groups(&self.meta.id)?;
        }
        *lock(&self.groups) = found;
        self.count_bytes();
        Ok(())
    }

    /// Bytes of a frame, and most frames of a group.
    pub(super) fn frame_bytes(&self) -> (usize, u32) {
        let facts = self.facts();
        let (points, rows) = facts.map_or((1, 1), |facts| (facts.points as usize, facts.unknowns as usize));
        (12 * points, group_frames(points, rows) as u32)
    }

    /// Removes files of frames that are all coded, now that those from `first` to `end` are. Returns their bytes.
    pub(super) fn remove_coded(&self, first: u32, end: u32) -> Result<u64, StoreError> {
        let (frame_bytes, most) = self.frame_bytes();
        let mut removed = 0;
        for file in (first / most * most..end).step_by(most as usize).filter(|file| file + most <= end) {
            lock(&self.groups).named.remove(&file);
            self.store.remove_frames(&self.meta.id, Some(file))?;
            removed += frame_bytes as u64 * u64::from(most);
        }
        Ok(removed)
    }

    /// Makes frames durable that wait for their group. Blocks.
    pub(super) fn keep_frames(&self, frames: &[(u32, &[u8])]) -> Result<(), StoreError> {
        let (frame_bytes, most) = self.frame_bytes();
        let mut frames = frames.to_vec();
        frames.sort_unstable_by_key(|(frame, _)| *frame);
        for together in frames.chunk_by(|a, b| a.0 / most == b.0 / most) {
            let first = together[0].0 / most * most;
            let is_known = lock(&self.groups).named.contains(&first);
            self.store.put_frames(&self.meta.id, first, is_known, frame_bytes, together)?;
            lock(&self.groups).named.insert(first);
        }
        Ok(())
    }

    /// Refuses an end within a coded group, of which nothing can be left out any more.
    ///
    /// # Errors
    /// `FRAME_CONFLICT`.
    pub(crate) fn check_end(&self, frames: u32) -> Result<(), ApiError> {
        let Some(group) = frames.checked_sub(1).and_then(|last| self.coded_group(last)) else { return Ok(()) };
        let end = group.first + group.frames;
        if frames == end {
            return Ok(());
        }
        let (first, last) = (group.first, end - 1);
        let fewer = if first > 0 { format!("{first} or ") } else { String::new() };
        let detail = format!(
            "frames {first} to {last} are coded together already, so none of them can be left out; complete with {fewer}at least {end} frames, or post the frames to a new session"
        );
        Err(ApiError::new(problem::FRAME_CONFLICT, detail))
    }

    /// Removes frames and groups that do not belong to a container of so many frames. Blocks.
    pub(super) fn remove_uncoded(&self, frames: u32) {
        if self.goal.is_none() {
            return;
        }
        // First out of the list, so that what is read meanwhile is not taken for damaged.
        lock(&self.groups).coded.retain(|group| group.first < frames);
        let removed = self.store.remove_frames(&self.meta.id, None);
        if let Err(error) = removed.and_then(|()| self.store.remove_groups_from(&self.meta.id, frames)) {
            tracing::warn!(session = %self.meta.id, %error, "frames that are not in the container still take space");
        }
        self.count_bytes();
    }

    /// Counts the bytes of its files and content on disk anew. Blocks.
    pub(super) fn count_bytes(&self) {
        match self.store.bytes_of_session(&self.meta) {
            Ok(counted) => self.set_bytes(counted),
            Err(error) => {
                tracing::warn!(session = %self.meta.id, %error, "its files cannot be counted; the count stays as it was");
            }
        }
    }

    pub(super) fn set_bytes(&self, SessionBytes { all, container }: SessionBytes) {
        self.bytes.store(all, Relaxed);
        self.container.store(container, Relaxed);
    }
}

/// The response for a frame that is not in the container.
fn left_out(frame: u32) -> ApiError {
    let detail = format!("frame {frame} was left out when the session was completed; ask for those before");
    ApiError::new(problem::FRAMES_MISSING, detail).frame(frame)
}
