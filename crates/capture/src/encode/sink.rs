//! Where solved frames go: into a container, as they are or coded group by group.

use super::EncodeError;
use super::batches::{Batch, SolvedBatch};
use crate::capture::{CaptureWriter, StoredError};
use crate::coding::{CodedGroup, GroupCoder};
use cager_core::decode::FrameError;
use cager_core::inversion::Convergence;
use cager_proto::report::{Seconds, WorstError};
use std::io::Write;
use std::path::PathBuf;
use std::time::Instant;

/// A container that is being written, and what is found out on the way.
pub(super) struct FrameSink<W: Write> {
    pub(super) writer: CaptureWriter<W>,
    /// Where frames are coded.
    pub(super) coder: Option<GroupCoder>,
    pub(super) seconds: Seconds,
    pub(super) convergence: Vec<Convergence>,
    /// Frames whose cages would have left them.
    pub(super) held: Vec<usize>,
    pub(super) worst: Option<WorstError>,
    /// Frames that came.
    pub(super) frames: usize,
    /// Of the rest pose: the unit of stored errors.
    pub(super) diagonal: f64,
    /// The container's.
    pub(super) path: PathBuf,
}

impl<W: Write> FrameSink<W> {
    /// Takes the next batch; gives it back where its frames are not kept.
    pub(super) fn take(&mut self, batch: Batch, solved: SolvedBatch) -> Result<Option<Batch>, EncodeError> {
        self.seconds.invert += solved.invert_seconds;
        self.seconds.measure += solved.measure_seconds;
        self.convergence.extend(solved.convergence);
        self.held.extend((self.frames..).zip(solved.held).filter_map(|(frame, held)| held.then_some(frame)));
        let count = batch.len();
        let unused = if self.coder.is_some() {
            for (frame, cage) in batch.into_iter().zip(solved.cages) {
                if self.coder.as_mut().is_some_and(|coder| coder.push(frame, cage)) {
                    self.close_group()?;
                }
            }
            None
        } else {
            let clock = Instant::now();
            for (k, (cage, error)) in solved.cages.iter().zip(&solved.errors).enumerate() {
                self.look_at(self.frames + k, error);
                let stored = StoredError::new(error, self.diagonal);
                self.writer.write_frame(cage, &stored).map_err(|cause| EncodeError::container(&self.path, cause))?;
            }
            self.seconds.write += clock.elapsed().as_secs_f64();
            Some(batch)
        };
        self.frames += count;
        Ok(unused)
    }

    /// Codes the frames that wait for a group, where there are any, and writes it.
    pub(super) fn close_group(&mut self) -> Result<(), EncodeError> {
        let Some(coder) = self.coder.as_mut().filter(|coder| !coder.is_empty()) else { return Ok(()) };
        let clock = Instant::now();
        let CodedGroup { cages, residual, errors, farthest } = coder.close()?;
        let before = self.writer.frames();
        let stored: Vec<StoredError> = errors.iter().map(|error| StoredError::of_coded(error, self.diagonal)).collect();
        // By what readers of the file will know, who take the first of equal ones.
        for (k, (error, stored)) in errors.iter().zip(&stored).enumerate() {
            self.look_at(before + k, &FrameError { linf: f64::from(stored.linf) * self.diagonal, ..*error });
        }
        self.seconds.code += clock.elapsed().as_secs_f64();
        let clock = Instant::now();
        let written = self.writer.write_group(&cages, residual.as_deref(), &stored, farthest);
        written.map_err(|cause| EncodeError::container(&self.path, cause))?;
        self.seconds.write += clock.elapsed().as_secs_f64();
        Ok(())
    }

    fn look_at(&mut self, frame: usize, error: &FrameError) {
        if self.worst.is_none_or(|worst| error.linf > worst.distance) {
            self.worst = Some(WorstError { frame, point: Some(error.worst), distance: error.linf });
        }
    }
}
