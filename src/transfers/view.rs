//! Transfers as the service tells of them.

use super::TransferJob;
use crate::decode::Positions;
use crate::jobs::{Phase, Piece};
use crate::store::{Kind, Store};
use cager_proto::messages::JobState;
use cager_proto::transfer_messages::{Transfer as View, TransferProgress};
use std::fs::File;
use std::io;
use std::os::unix::fs::FileExt as _;
use std::sync::Arc;

impl TransferJob {
    /// The transfer as returned by the API.
    pub(crate) fn view(&self) -> View {
        let (state, meta) = (self.progress(), &self.meta);
        let TransferProgress { state, stage, frames, moved } = state;
        let mut view = View {
            id: meta.id.clone(),
            name: meta.options.name.clone(),
            state,
            stage,
            created: meta.created_ms as f64 / 1e3,
            points: meta.points,
            frames,
            moved,
            origin: meta.origin,
            cage_vertices: None,
            container_bytes: None,
            warnings: Vec::new(),
            problem: None,
        };
        match self.phase() {
            Phase::Waiting | Phase::Running => {}
            Phase::Completed(found) => {
                view.cage_vertices = Some(found.cage_vertices);
                view.container_bytes = found.files.iter().find(|f| f.name == "capture.cager").map(|f| f.bytes);
                view.warnings = found.warnings;
            }
            Phase::Failed(problem) => view.problem = Some(*problem),
        }
        view
    }

    /// State and progress, for server-sent events.
    pub(crate) fn progress(&self) -> TransferProgress {
        let status = self.status();
        let state = match &status.phase {
            Phase::Waiting => JobState::Queued,
            Phase::Running => JobState::Running,
            Phase::Completed(_) => JobState::Completed,
            Phase::Failed(_) => JobState::Failed,
        };
        let frames = self.meta.frames;
        let moved = if state == JobState::Completed { frames } else { status.progress.moved };
        TransferProgress { state, stage: status.progress.stage, frames, moved }
    }
}

/// Where the positions of a transfer's frames come from.
enum Positioned {
    /// As they are moved.
    Live(Arc<File>),
    /// What a decoder gets back.
    Decoded(Box<Positions>),
}

/// Positions of a transfer for one reader, who gets all from one place: as they are moved where it runs, else decoded.
#[derive(Default)]
pub(crate) struct TransferFrames(Option<Positioned>);

impl TransferFrames {
    /// Positions from frame `first` on, at most `most`, n × 12 bytes each. Blocks.
    ///
    /// # Errors
    /// The transfer failed, or its files cannot be read.
    pub(crate) fn read(&mut self, job: &TransferJob, store: &Store, first: u32, most: u32) -> io::Result<Piece> {
        let (phase, live) = (job.phase(), job.status().progress.live.clone());
        if self.0.is_none() {
            self.0 = match (&phase, live) {
                (Phase::Completed(_), _) => {
                    let path = store.job_file(Kind::Transfer, job.id(), "capture.cager").map_err(io::Error::other)?;
                    Some(Positioned::Decoded(Box::new(Positions::open(&path).map_err(io::Error::other)?)))
                }
                (_, live) => live.map(Positioned::Live),
            };
        }
        if let Phase::Failed(_) = phase {
            return Err(io::Error::other("the transfer failed"));
        }
        let done = job.progress().moved;
        let frames = most.min(done.saturating_sub(first));
        let is_last = first >= job.meta.frames;
        let numbers: Vec<f32> = match &mut self.0 {
            _ if frames == 0 => Vec::new(),
            None => return Ok(Piece { is_last, ..Piece::default() }),
            Some(Positioned::Decoded(positions)) => {
                let wanted: Vec<usize> = (first..first + frames).map(|frame| frame as usize).collect();
                positions.read(&wanted).map_err(io::Error::other)?.concat()
            }
            Some(Positioned::Live(file)) => {
                let stride = 24 * u64::from(job.meta.points);
                let mut bytes = vec![0; (stride * u64::from(frames)) as usize];
                file.read_exact_at(&mut bytes, stride * u64::from(first))?;
                bytes.as_chunks().0.iter().map(|&x| f64::from_le_bytes(x) as f32).collect()
            }
        };
        Ok(Piece { bytes: numbers.iter().flat_map(|x| x.to_le_bytes()).collect(), frames, is_last })
    }
}
