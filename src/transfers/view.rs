//! Transfers as the service tells of them.

use super::TransferJob;
use crate::admission::Held;
use crate::decode::Positions;
use crate::jobs::{Phase, Piece};
use crate::service::Service;
use crate::store::Kind;
use cager_proto::messages::JobState;
use cager_proto::transfer_messages::{Transfer as View, TransferProgress};
use std::fs::File;
use std::io;
use std::ops::Range;
use std::os::unix::fs::FileExt as _;
use std::sync::Arc;
use tokio::runtime::Handle;

/// Part of a tenant's share of the memory for downloads that the coordinates for one reader may take.
const PARTS: u64 = 4;

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
    /// What a decoder gets back, with the permit for the coordinates that it keeps.
    Decoded { positions: Box<Positions>, _memory: Option<Held> },
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

    /// Positions from frame `first` on, at most `most`, n × 12 bytes each. Call on a thread that may block, within a tokio runtime.
    ///
    /// # Errors
    /// The transfer failed or is deleted, its files cannot be read, or the service stops.
    pub(crate) fn read(&mut self, job: &TransferJob, first: u32, most: u32) -> io::Result<Piece> {
        let (phase, live) = (job.phase(), job.status().progress.live.clone());
        if let Phase::Failed(_) = phase {
            return Err(io::Error::other("the transfer failed"));
        }
        self.from = self.from.take().or_else(|| live.map(Positioned::Live));
        let frames = most.min(job.progress().moved.saturating_sub(first));
        let is_last = first >= job.meta.frames;
        let numbers: Vec<f32> = match &self.from {
            _ if frames == 0 => Vec::new(),
            None if !phase.is_final() => return Ok(Piece { is_last, ..Piece::default() }),
            Some(Positioned::Live(file)) => {
                let stride = 24 * u64::from(job.meta.points);
                let mut bytes = vec![0; (stride * u64::from(frames)) as usize];
                file.read_exact_at(&mut bytes, stride * u64::from(first))?;
                bytes.as_chunks().0.iter().map(|&x| f64::from_le_bytes(x) as f32).collect()
            }
            _ => self.decoded(job, first..first + frames)?,
        };
        Ok(Piece { bytes: numbers.iter().flat_map(|x| x.to_le_bytes()).collect(), frames, is_last })
    }

    /// Positions of these frames from the container, on the threads that decode, in a place among what they do.
    fn decoded(&mut self, job: &TransferJob, frames: Range<u32>) -> io::Result<Vec<f32>> {
        let Self { service, from } = self;
        let _place = Handle::current().block_on(async {
            tokio::select! {
                place = service.coding.take(&job.meta.tenant, 1) => Ok(place),
                () = job.deleted().cancelled() => Err(io::Error::other("the transfer was deleted")),
                () = service.stopping().cancelled() => Err(io::Error::other("the service is stopping")),
            }
        })?;
        let frames: Vec<usize> = frames.map(|frame| frame as usize).collect();
        service.coders.install(|| {
            if from.is_none() {
                let path =
                    service.store.job_file(Kind::Transfer, job.id(), "capture.cager").map_err(io::Error::other)?;
                let (memory, mut held) = (&service.download_memory, None);
                // Without room for them, coordinates are computed anew for each piece.
                let keeps = |bytes: u64| {
                    held = memory.try_take(&job.meta.tenant, bytes).ok().filter(|_| bytes <= memory.most() / PARTS);
                    held.is_some()
                };
                let positions = Positions::open(&path, keeps).map_err(io::Error::other)?;
                *from = Some(Positioned::Decoded { positions: Box::new(positions), _memory: held });
            }
            let Some(Positioned::Decoded { positions, .. }) = from else { return Ok(Vec::new()) };
            Ok(positions.read(&frames).map_err(io::Error::other)?.concat())
        })
    }
}
