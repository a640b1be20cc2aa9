//! Transfers as the service tells of them.

use super::{Transfer, TransferJob};
use crate::jobs::{Frames, Phase, Piece};
use crate::service::Service;
use crate::store::Kind;
use cager_capture::decode::Animation;
use cager_proto::messages::JobState;
use cager_proto::transfer_messages::{Transfer as View, TransferProgress};
use std::fs::File;
use std::io;
use std::ops::Range;
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
    Decoded(Box<Animation>),
}

/// Positions of a transfer for one reader, who gets all from one place: as they are moved where it runs, else decoded.
pub(crate) struct TransferFrames {
    service: Arc<Service>,
    from: Option<Positioned>,
}

impl TransferFrames {
    pub(crate) fn new(service: Arc<Service>) -> Self {
        Self { service, from: None }
    }

    /// Positions of these frames from the container, on the threads that decode.
    fn decoded(&mut self, job: &TransferJob, frames: Range<u32>) -> io::Result<Vec<f32>> {
        let Self { service, from } = self;
        let frames: Vec<usize> = frames.map(|frame| frame as usize).collect();
        service.coders.install(|| {
            if from.is_none() {
                let path =
                    service.store.job_file(Kind::Transfer, job.id(), "capture.cager").map_err(io::Error::other)?;
                service.store.bring(&path)?;
                *from = Some(Positioned::Decoded(Box::new(Animation::open(&path).map_err(io::Error::other)?)));
            }
            let Some(Positioned::Decoded(positions)) = from else { return Ok(Vec::new()) };
            Ok(positions.read(&frames).map_err(io::Error::other)?.concat())
        })
    }
}

impl Frames<Transfer> for TransferFrames {
    /// The coordinates are kept, so that they are computed once.
    fn decodes(&self, job: &TransferJob) -> Option<u64> {
        match (job.phase(), &self.from) {
            (Phase::Completed(found), None | Some(Positioned::Decoded(_))) => {
                Some(4 * u64::from(job.meta.points) * u64::from(found.cage_vertices))
            }
            _ => None,
        }
    }

    /// n × 12 bytes each.
    fn read(&mut self, job: &TransferJob, first: u32, most: u32, may_decode: bool) -> io::Result<Piece> {
        let (phase, live) = (job.phase(), job.status().progress.live.clone());
        if let Phase::Failed(_) = phase {
            return Err(io::Error::other("the transfer failed"));
        }
        self.from = self.from.take().or_else(|| live.map(Positioned::Live));
        let frames = most.min(job.progress().moved.saturating_sub(first));
        let is_last = first >= job.meta.frames;
        let numbers: Vec<f32> = match &self.from {
            _ if frames == 0 => Vec::new(),
            Some(Positioned::Live(file)) => {
                let stride = 24 * u64::from(job.meta.points);
                let mut bytes = vec![0; (stride * u64::from(frames)) as usize];
                file.read_exact_at(&mut bytes, stride * u64::from(first))?;
                bytes.as_chunks().0.iter().map(|&x| f64::from_le_bytes(x) as f32).collect()
            }
            // The end of the transfer wakes who waits for its frames.
            _ if !may_decode => return Ok(Piece { is_last, ..Piece::default() }),
            _ => self.decoded(job, first..first + frames)?,
        };
        Ok(Piece { bytes: numbers.iter().flat_map(|x| x.to_le_bytes()).collect(), frames, is_last })
    }
}
