//! Recoveries as the service tells of them.

use super::{Finished, Progress, Recovery, RecoveryJob};
use crate::jobs::{Phase, Piece, Status};
use crate::store::{Kind, Store, StoreError};
use cager_proto::recovery_messages::{
    FollowedFrame, Recovery as View, RecoveryFrames, RecoveryProgress, RecoveryState,
};
use std::io::{self, Read as _, Seek as _, SeekFrom};

/// Missing ranges in a view, at most.
const RANGES: usize = 100;
/// Frames in an event, at most.
const TOLD: usize = 1000;
/// The file of all cages of a completed recovery.
pub(super) const CAGES: &str = "cages";

impl RecoveryJob {
    /// The recovery as returned by the API.
    pub(crate) fn view(&self) -> View {
        self.view_of(&self.status())
    }

    fn view_of(&self, status: &Status<Recovery>) -> View {
        let progress = &status.progress;
        let vertices = progress.followed.first().map(|first| first.cage.len() as u32);
        let mut view = View {
            id: self.meta.id.clone(),
            name: self.meta.options.name.clone(),
            state: state_of(&status.phase, progress),
            created: self.meta.created_ms as f64 / 1e3,
            points: self.meta.points,
            cage_vertices: vertices.filter(|&vertices| vertices > 0),
            origin: self.meta.origin,
            joints: self.meta.parts.rig.is_some(),
            frames: RecoveryFrames {
                received: progress.received.max(progress.frames.len() as u32),
                followed: progress.followed.len() as u32,
                refined: progress.refined,
                lost: progress.followed.iter().filter(|frame| frame.outcome == "lost").count() as u32,
                declared: progress.declared,
                missing: if status.phase.is_final() { Vec::new() } else { missing(progress, None) },
            },
            container_bytes: None,
            warnings: Vec::new(),
            problem: None,
        };
        match &status.phase {
            Phase::Waiting | Phase::Running => {}
            Phase::Completed(found) => {
                view.cage_vertices = Some(found.cage_vertices);
                let [received, followed, refined] = [found.frames; 3];
                let declared = Some(received);
                view.frames =
                    RecoveryFrames { received, followed, refined, lost: found.lost, declared, missing: Vec::new() };
                view.container_bytes = found.files.iter().find(|f| f.name == "capture.cager").map(|f| f.bytes);
                view.warnings = found.warnings.clone();
            }
            Phase::Failed(problem) => view.problem = Some((**problem).clone()),
        }
        view
    }

    /// State and progress for server-sent events, with the frames from `told` on, and whether nothing follows.
    pub(crate) fn progress_from(&self, told: u32) -> (RecoveryProgress, bool) {
        let status = self.status();
        let View { state, frames: RecoveryFrames { received, followed, refined, .. }, .. } = self.view_of(&status);
        let is_last = status.phase.is_final() && status.progress.followed.len() <= told as usize + TOLD;
        let new = status.progress.followed.iter().enumerate().skip(told as usize).take(TOLD);
        let frames = new.map(|(frame, found)| FollowedFrame {
            frame: frame as u32,
            score: found.score,
            joints: found.joints.clone(),
            outcome: found.outcome.to_owned(),
        });
        (RecoveryProgress { state, received, followed, refined, frames: frames.collect() }, is_last)
    }

    /// Cages of the first pass from frame `first` on, at most `most`, m × 12 bytes each.
    ///
    /// # Errors
    /// It is over, so that its cages are others, or none.
    pub(crate) fn first_cages(&self, first: u32, most: u32) -> io::Result<Piece> {
        let status = self.status();
        match &status.phase {
            Phase::Completed(finished) if first >= finished.frames => {
                return Ok(Piece { is_last: true, ..Piece::default() });
            }
            Phase::Completed(_) => {
                return Err(io::Error::other("the recovery is completed, and its cages are other ones now"));
            }
            Phase::Failed(_) => return Err(io::Error::other("the recovery failed")),
            Phase::Waiting | Phase::Running => {}
        }
        let progress = &status.progress;
        let found = progress.followed.iter().skip(first as usize).take(most as usize);
        let frames = found.len() as u32;
        let bytes = found.flat_map(|found| found.cage.as_flattened()).flat_map(|x| x.to_le_bytes()).collect();
        Ok(Piece { bytes, frames, is_last: progress.declared.is_some_and(|declared| first >= declared) })
    }

    /// Cages of a completed recovery from frame `first` on, at most `most`, m × 12 bytes each; none after the last. Blocks.
    ///
    /// # Errors
    /// The file of all cages cannot be read.
    pub(crate) fn final_cages(
        &self,
        store: &Store,
        finished: &Finished,
        (first, most): (u32, u32),
    ) -> io::Result<Piece> {
        let stride = 12 * u64::from(finished.cage_vertices);
        let frames = most.min(finished.frames.saturating_sub(first));
        let mut bytes = vec![0; (stride * u64::from(frames)) as usize];
        let mut read = || {
            let path = store.job_file(Kind::Recovery, &self.meta.id, CAGES)?;
            let failed = |error| StoreError::of(&path, "read", error);
            let mut file = store.open_file(&path)?;
            file.seek(SeekFrom::Start(stride * u64::from(first))).map_err(failed)?;
            file.read_exact(&mut bytes).map_err(failed)
        };
        read().map_err(|error| self.fail_if_damaged(store, error))?;
        Ok(Piece { bytes, frames, is_last: true })
    }
}

fn state_of(phase: &Phase<Finished>, progress: &Progress) -> RecoveryState {
    match phase {
        Phase::Completed(_) => RecoveryState::Completed,
        Phase::Failed(_) => RecoveryState::Failed,
        _ if progress.declared.is_some() => RecoveryState::Finishing,
        _ if progress.has_work() => RecoveryState::Following,
        _ => RecoveryState::Ready,
    }
}

/// Ranges of frames that are missing below the highest, or below `end`; the first ones.
pub(super) fn missing(progress: &Progress, end: Option<u32>) -> Vec<[u32; 2]> {
    let mut ranges = Vec::new();
    let mut next = progress.arrived;
    let there = progress.frames.range(next..).map(|(&frame, _)| frame);
    for frame in there.chain(end) {
        if frame > next && ranges.len() < RANGES {
            ranges.push([next, frame]);
        }
        next = next.max(frame.saturating_add(1));
    }
    ranges
}
