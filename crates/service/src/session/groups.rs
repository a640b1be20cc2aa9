//! Sessions made with a goal for error, size or quality: their frames wait on disk until their group is whole, and are then coded.

use super::container_frames::ContainerFrames;
use super::facts::Facts;
use super::{Phase, Session};
use crate::preparation::{Geometry, Prepared, ValidOptions, cannot_be_coded};
use crate::problem::{self, ApiError};
use crate::service::Service;
use crate::store::{FrameEntry, SessionBytes, StoreError};
use crate::sync::lock;
use crate::tasks::blocking;
use cager_capture::capture::StoredError;
use cager_capture::coding::{Carried, Goal, GroupCoder, GroupDecoder, group_frames};
use cager_proto::le;
use cager_proto::messages::CodedFrames;
use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;
use std::io;
use std::sync::Arc;
use std::sync::atomic::Ordering::Relaxed;
use std::time::Duration;

/// Pause before a group is tried again that could not be stored.
const RETRY: Duration = Duration::from_secs(30);

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
    fn end(&self) -> (u32, Carried) {
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

    fn add(&mut self, first: u32, group: &StoredGroup, bytes: u64) {
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
    fn frame_bytes(&self) -> (usize, u32) {
        let facts = self.facts();
        let (points, rows) = facts.map_or((1, 1), |facts| (facts.points as usize, facts.unknowns as usize));
        (12 * points, group_frames(points, rows) as u32)
    }

    /// Removes files of frames that are all coded, now that those from `first` to `end` are. Returns their bytes.
    fn remove_coded(&self, first: u32, end: u32) -> Result<u64, StoreError> {
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

    /// The entries of the next group: all of them solved, and the group as long as groups are, or up to `end`, which a completion says.
    fn next_group(&self, end: Option<u32>) -> Option<Vec<FrameEntry>> {
        self.facts()?;
        let (_, most) = self.frame_bytes();
        let (first, count) = {
            let groups = lock(&self.groups);
            let (first, _) = groups.end();
            let count = end.map_or(most, |end| most.min(end.saturating_sub(first)));
            // With fewer frames it might go.
            if groups.failed.as_ref().is_some_and(|(failed, _)| count >= *failed) {
                return None;
            }
            (first, count)
        };
        let frames = self.frames();
        let waits = end.is_none() && frames.is_sealed();
        let is_whole = count > 0 && !waits && frames.run_length(first) >= u64::from(count);
        is_whole.then(|| frames.run(first, count as usize))
    }

    /// Codes a group and stores it; for good, unless it is only coded like this because the session is completed with `end` frames. Blocks.
    fn code(
        &self,
        goal: Goal,
        coder: &mut GroupCoder,
        diagonal: f64,
        entries: &[FrameEntry],
        end: Option<u32>,
    ) -> Result<(), ApiError> {
        let (first, row_bytes) = (entries[0].frame, 12 * self.facts().map_or(0, |facts| facts.unknowns as usize));
        let mut cages = Vec::new();
        self.read_cages(entries, &mut cages)?;
        let (frame_bytes, most) = self.frame_bytes();
        let is_shared_out_anew = matches!(goal, Goal::Size(_)) && end != self.meta.options.frames;
        let is_last = end.is_some() && (entries.len() < most as usize || is_shared_out_anew);
        let mut frame = vec![0; frame_bytes];
        for (entry, cage) in entries.iter().zip(cages.chunks_exact(row_bytes)) {
            let read = self.store.read_frame(&self.meta.id, entry.frame / most * most, entry.frame, &mut frame);
            let read = read.and_then(|()| match entry.full_digest {
                Some(digest) if blake3::hash(&frame).as_bytes()[..16] == digest => Ok(()),
                _ => Err(self.damaged(format!("frame {} does not match its checksum", entry.frame))),
            });
            read.map_err(|error| self.fail_if_damaged(error))?;
            coder.push(le::f32s(&frame).into_iter().map(f64::from).collect(), le::f32s(cage));
        }
        let coded = coder.close().map_err(|error| {
            let mut error = cannot_be_coded(goal, &error);
            let last = first + (entries.len() as u32 - 1);
            error.problem.detail = format!("frames {first} to {last}: {}", error.problem.detail);
            tracing::info!(session = %self.meta.id, detail = %error.problem.detail, "frames cannot be coded");
            // With more frames it may go, where there may be more.
            if !is_last || end == self.meta.options.frames {
                lock(&self.groups).failed = Some((entries.len() as u32, error.clone()));
                self.touch();
            }
            error
        })?;
        let errors = coded.errors.iter().map(|error| StoredError::of_coded(error, diagonal)).collect();
        let group = StoredGroup {
            cages: coded.cages,
            residual: coded.residual,
            errors,
            farthest: coded.farthest,
            carried: coder.carried(),
        };
        let put = self.store.put_group(&self.meta.id, first, is_last, &group);
        let put = put.map_err(|error| self.storage_error(error))?;
        self.bytes.fetch_add(put, Relaxed);
        if is_last {
            let StoredGroup { errors, carried, .. } = group;
            let group = GroupOnDisk { first, frames: errors.len() as u32, bytes: put };
            lock(&self.groups).last.push(LastGroup { group, errors, carried });
            return Ok(());
        }
        self.frames().set_errors(first, &group.errors);
        {
            let mut groups = lock(&self.groups);
            groups.failed = None;
            groups.add(first, &group, put);
        }
        match self.remove_coded(first, first + entries.len() as u32) {
            Ok(removed) => {
                let less = |bytes: u64| Some(bytes.saturating_sub(removed));
                let _ = self.bytes.fetch_update(Relaxed, Relaxed, less);
            }
            // The next start does it.
            Err(error) => tracing::warn!(session = %self.meta.id, %error, "frames that are coded still take space"),
        }
        self.count_coded(entries.len());
        self.touch();
        Ok(())
    }

    pub(super) fn count_coded(&self, frames: usize) {
        metrics::counter!("cager_coded_frames_total", "tenant" => self.meta.tenant.clone()).increment(frames as u64);
    }

    /// The coder of the next group. Blocks.
    fn coder(&self, prepared: &Prepared, goal: Goal) -> Result<GroupCoder, ApiError> {
        let geometry = self.geometry()?;
        let model = self.group_decoder(prepared, &geometry, goal)?;
        let most = group_frames(prepared.solver.decoder().points(), prepared.solver.decoder().unknowns());
        let (_, mut carried) = lock(&self.groups).end();
        if carried.frames == 0 {
            let meshes = ContainerFrames::begin(self, prepared, &geometry, io::sink());
            let meshes = meshes.map_err(|error| ApiError::internal(&error))?;
            carried.room = goal.room(meshes.bytes(), self.meta.options.frames.unwrap_or(0) as usize);
        }
        Ok(GroupCoder::new(goal, model, geometry.unit, most, carried))
    }

    fn group_decoder(
        &self,
        prepared: &Prepared,
        geometry: &Geometry,
        goal: Goal,
    ) -> Result<Arc<GroupDecoder>, ApiError> {
        let system = ValidOptions::of(&self.meta.options)?.system;
        let mut kept = lock(&self.group_decoder);
        if let Some(decoder) = kept.upgrade() {
            return Ok(decoder);
        }
        let made = GroupDecoder::new(system, &geometry.cage, &geometry.rest, &prepared.solver);
        let made = Arc::new(made.map_err(|error| cannot_be_coded(goal, &error))?);
        *kept = Arc::downgrade(&made);
        Ok(made)
    }

    /// What decodes the session's groups, shared while it is used. Blocks.
    ///
    /// # Errors
    /// Content that is gone; coordinates that cannot be computed.
    pub(crate) fn decoder_of_groups(&self, prepared: &Prepared, goal: Goal) -> Result<Arc<GroupDecoder>, ApiError> {
        if let Some(decoder) = lock(&self.group_decoder).upgrade() {
            return Ok(decoder);
        }
        self.group_decoder(prepared, &self.geometry()?, goal)
    }
}

impl Service {
    /// Codes the frames of a session, where they are to be, as groups become whole.
    pub(crate) fn code_in_background(self: &Arc<Self>, session: &Arc<Session>) {
        if session.goal().is_some() {
            tokio::spawn(Arc::clone(self).run_group_coder(Arc::clone(session)));
        }
    }

    async fn run_group_coder(self: Arc<Self>, session: Arc<Session>) {
        let mut changes = session.changes();
        loop {
            changes.mark_unchanged();
            let mut failed = false;
            match session.status().phase {
                Phase::Completed(_) | Phase::Failed(_) => return,
                Phase::Ready => {
                    let coded = self.code_next_in_turn(&session).await;
                    match coded {
                        Ok(true) => continue,
                        Ok(false) => {}
                        Err(error) => {
                            failed = true;
                            tracing::warn!(session = %session.meta.id, detail = %error.problem.detail, "a group is not coded");
                        }
                    }
                }
                Phase::Preparing => {}
            }
            tokio::select! {
                changed = changes.changed() => if changed.is_err() { return },
                // A disk may have space again.
                () = tokio::time::sleep(RETRY), if failed => {}
                () = session.deleted().cancelled() => return,
                () = self.stopping().cancelled() => return,
            }
        }
    }

    async fn code_next_in_turn(self: &Arc<Self>, session: &Arc<Session>) -> Result<bool, ApiError> {
        session.ensure_loaded().await?;
        if session.next_group(None).is_none() {
            return Ok(false);
        }
        self.code_next(session, None).await
    }

    /// Codes all that is left below `end`, the last group as well.
    ///
    /// # Errors
    /// Frames that cannot be coded as asked for; storage errors.
    pub(crate) async fn code_rest(self: &Arc<Self>, session: &Arc<Session>, end: u32) -> Result<(), ApiError> {
        if session.goal().is_none() {
            return Ok(());
        }
        session.ensure_loaded().await?;
        while self.code_next(session, Some(end)).await? {}
        // A group that was being coded may have gone beyond.
        session.check_end(end)?;
        let (coded, _) = lock(&session.groups).end();
        if coded < end { session.check_coding() } else { Ok(()) }
    }

    /// Codes the next group. Returns false if no group is complete.
    async fn code_next(self: &Arc<Self>, session: &Arc<Session>, end: Option<u32>) -> Result<bool, ApiError> {
        let Some(goal) = session.goal() else { return Ok(false) };
        // A place for each group, so that others get their turn; before the lock, so that who has that need not wait for a place.
        let place = self.coding.take(&session.meta.tenant, 1).await;
        let mut coding = Arc::clone(&session.coding).lock_owned().await;
        let Some(entries) = session.next_group(end) else { return Ok(false) };
        let prepared = self.solver(session).await?;
        let (session, threads) = (Arc::clone(session), Arc::clone(&self.coders));
        let work = move || {
            let _place = place;
            threads.install(|| -> Result<(), ApiError> {
                // After an error, and after a completion that failed, the coder is made anew, from what is on disk.
                let next = entries[0].frame as usize;
                let kept = coding.take().filter(|coder| coder.carried().frames == next);
                let mut coder = kept.map_or_else(|| session.coder(&prepared, goal), Ok)?;
                if let Some(end) = end {
                    coder.expect((end - entries[0].frame) as usize);
                }
                session.code(goal, &mut coder, prepared.solver.diagonal(), &entries, end)?;
                *coding = Some(coder);
                Ok(())
            })
        };
        blocking(work).await??;
        Ok(true)
    }
}

impl Session {
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

    /// Forgets what coding keeps in memory.
    pub(super) fn forget_coder(&self) {
        if let Ok(mut coder) = self.coding.try_lock() {
            *coder = None;
        }
    }
}

/// The response for a frame that is not in the container.
fn left_out(frame: u32) -> ApiError {
    let detail = format!("frame {frame} was left out when the session was completed; ask for those before");
    ApiError::new(problem::FRAMES_MISSING, detail).frame(frame)
}
