//! Coding the frames of a session, group by group, as soon as all frames of one are there.

use super::container_frames::ContainerFrames;
use super::groups::{GroupOnDisk, LastGroup, StoredGroup};
use super::{Phase, Session};
use crate::preparation::{Geometry, Prepared, ValidOptions, cannot_be_coded};
use crate::problem::ApiError;
use crate::service::Service;
use crate::store::FrameEntry;
use crate::sync::lock;
use crate::tasks::blocking;
use cager_capture::capture::StoredError;
use cager_capture::coding::{Goal, GroupCoder, GroupDecoder, group_frames};
use cager_codec::{BasisRecord, CageBasis};
use cager_proto::le;
use std::io;
use std::sync::Arc;
use std::sync::atomic::Ordering::Relaxed;
use std::time::Duration;

/// Pause before a group is tried again that could not be stored.
const RETRY: Duration = Duration::from_secs(5);

impl Service {
    /// Codes the frames of a session, where they are to be, as groups become whole.
    pub(crate) fn code_in_background(self: &Arc<Self>, session: &Arc<Session>) {
        if session.goal().is_some() {
            tokio::spawn(Arc::clone(self).run_group_coder(Arc::clone(session)));
        }
    }

    async fn run_group_coder(self: Arc<Self>, mut session: Arc<Session>) {
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
            // While nothing happens it can be unloaded.
            let (deleted, waiting) = (session.deleted().clone(), Arc::downgrade(&session));
            drop(session);
            tokio::select! {
                changed = changes.changed() => if changed.is_err() { return },
                // A disk may have space again.
                () = tokio::time::sleep(RETRY), if failed => {}
                () = deleted.cancelled() => return,
                () = self.stopping().cancelled() => return,
            }
            let Some(again) = waiting.upgrade() else { return };
            session = again;
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

    /// The basis of groups that are not in the one that this program codes in on this machine, as of earlier programs. Blocks.
    pub(crate) fn basis_of_groups(&self, prepared: &Prepared, record: &BasisRecord) -> Option<CageBasis> {
        let system = ValidOptions::of(&self.meta.options).ok()?.system;
        let Geometry { cage, rest, .. } = self.geometry().ok()?;
        let plan = prepared.solver.preparation().plan.as_ref();
        Some(CageBasis::of(system, &cage, &rest.points, plan, Some(record)).ok()??.0)
    }

    /// Forgets what coding keeps in memory.
    pub(super) fn forget_coder(&self) {
        if let Ok(mut coder) = self.coding.try_lock() {
            *coder = None;
        }
    }
}
