//! Moving motions: a limited number of transfers at a time, tenants in turn, on the threads of the lowest priority.

use super::valid_options::{ValidOptions, design_of};
use super::{Finished, Transfer, TransferJob, pairs_of};
use crate::admission::Permit;
use crate::cage_job::samples;
use crate::jobs::{Ended, Jobs, MAX_ATTEMPTS, ResultsError, Run, Stoppable};
use crate::preparation::{cage_of, read_part, read_part_with_units};
use crate::problem::{self, ApiError};
use crate::service::Service;
use crate::store::{PAIRS, SOURCE, SOURCE_FRAMES, StoreError, TransferMeta, Workshop};
use cager_cages::{DesignError, Progress as DesignProgress};
use cager_capture::decode::DecodeError;
use cager_capture::design::FRAMES;
use cager_capture::encode::{EncodeError, EncodeProgress, Encoded, sample_frames};
use cager_capture::origin::move_to;
use cager_capture::timing::Timing;
use cager_core::cage::Cage;
use cager_core::coordinates::MeanValue;
use cager_formats::{FrameReader, Target, Units};
use cager_geometry::mesh::Model;
use cager_motion::recover::Encoding;
use cager_motion::transfer::{self, MethodChoice, MotionFile, TransferFailed, Transferred, about_origin, decoded};
use cager_proto::report::json_file;
use cager_proto::transfer_messages::TransferStage;
use cager_shape::TransferError;
use std::fs::File;
use std::ops::ControlFlow;
use std::path::Path;
use std::sync::Arc;

impl Run for Transfer {
    fn jobs(service: &Service) -> &Arc<Jobs<Self>> {
        &service.transfers
    }

    fn turn(service: &Service, job: &Arc<TransferJob>) -> impl Future<Output = Option<Permit>> + Send {
        service.place(job, &service.transferring)
    }

    fn work(service: &Arc<Service>, job: &Arc<TransferJob>, _place: Permit) -> Ended<Finished> {
        service.transfer(job)
    }
}

impl Service {
    /// Moves the motion of a job. Blocks.
    fn transfer(&self, job: &TransferJob) -> Ended<Finished> {
        let given_up = || {
            let detail = format!(
                "the service ended {MAX_ATTEMPTS} times while this transfer ran, so it is given up; restart the service with more memory, or make the transfer anew with a lighter model"
            );
            Ended::GivenUp(ApiError::new(problem::TRANSFER_FAILED, detail))
        };
        self.attempt(job, given_up, || self.designs.threads().install(|| self.transferred(job)))
    }

    fn transferred(&self, job: &TransferJob) -> Result<(Finished, Workshop), ApiError> {
        let (meta, workshop) = (&job.meta, self.store.workshop()?);
        let damaged = |error: StoreError| job.fail_if_damaged(&self.store, error);
        let part = |name: &str| self.store.transfer_part(meta, name).map_err(damaged);
        let valid = ValidOptions::of(&meta.options, meta.parts.contains_key("cage"))?;
        let file = part("target")?.ok_or_else(|| ApiError::internal(&"a transfer has no target"))?;
        let (mut target, units) = read_part_with_units("target", &file.name, &file.bytes)?;
        // Nothing asks for them, as on the command line.
        target.surface.pictures.clear();
        move_to(meta.origin, &mut target.points);
        let is_fitted = valid.method == MethodChoice::Fitted;
        let cage = part("cage")?.map(|file| cage_of(&file, meta.origin.filter(|_| !is_fitted))).transpose()?;
        let source = match part("source_rest")? {
            Some(rest) => {
                let rest = read_part("source_rest", &rest.name, &rest.bytes)?;
                let frames = self.store.transfer_frames(meta).map_err(damaged)?;
                let (name, file) = frames.ok_or_else(|| ApiError::internal(&"a transfer has no frames"))?;
                let bytes = file.bytes();
                let frames = samples::open(name, file, bytes, rest.points.len(), meta.options.frames)?;
                Source::of_files(rest, frames)
            }
            None => Source::of_container(&self.store.transfer_source(job.id())?, workshop.path())?,
        };
        let Source { rest, cage: own_cage, mut frames, frame_rate, numbers } = source;
        let points = [&rest, &target].map(|model| model.points.len());
        let pairs = part(PAIRS)?.map(|file| pairs_of(&file, points)).transpose()?.unwrap_or_default();
        let timing = Timing { fps: meta.options.frame_rate, start: meta.options.start };
        let stopped = || self.is_stopped(job);
        let timing = (timing.fps.or(frame_rate), Some(timing.numbers(numbers)));
        let mut frames = Stoppable { frames: frames.as_mut(), stopped: &stopped, timing };
        let moving = transfer::TransferJob {
            source: rest,
            cage: cage.or(own_cage.filter(|_| is_fitted)),
            frames: &mut frames,
            target: &target,
            method: valid.method,
            pose: valid.pose,
            align: about_origin(valid.align, meta.origin),
            up: valid.up,
            pairs,
            detail: meta.options.detail,
            system: valid.system,
            stopped: &stopped,
            scratch: workshop.path(),
        };
        let counted = metrics::counter!("cager_transferred_frames_total", "tenant" => meta.tenant.clone());
        let live = workshop.path().join(transfer::MOVED);
        let moved = transfer::transfer(moving, &|done| {
            job.progressed(|progress| {
                progress.stage = Some(TransferStage::Moving);
                let more = (done as u32).saturating_sub(progress.moved);
                counted.increment(u64::from(more));
                progress.moved = done as u32;
                if progress.live.is_none() {
                    progress.live = File::open(&live).ok().map(Arc::new);
                }
            });
        });
        let moved = moved.map_err(|error| refused(&error, &job.meta))?;
        let finished = self.results(job, &valid, (&target, units), moved, &workshop)?;
        Ok((finished, workshop))
    }

    /// Designs the target's cage and writes all results into the workshop.
    fn results(
        &self,
        job: &TransferJob,
        valid: &ValidOptions,
        (target, units): (&Model, Units),
        moved: Transferred,
        workshop: &Workshop,
    ) -> Result<Finished, ApiError> {
        let enter = |stage| job.progressed(|progress| progress.stage = Some(stage));
        let options = &job.meta.options;
        let Transferred { mut frames, report, mut warnings } = moved;
        enter(TransferStage::Designing);
        let failed = |error: EncodeError| ApiError::from(&ResultsError::from(error));
        let samples = sample_frames(&mut frames, FRAMES, false).map_err(failed)?;
        frames.rewind().map_err(|error| ApiError::internal(&error))?;
        let go_on = &mut |_: DesignProgress<'_>| {
            if self.is_stopped(job) { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        };
        let design = design_of(options, target.points.len());
        let design = self.designs.design(target, &samples, &design, go_on).map_err(|error| match error {
            DesignError::Stopped => ApiError::internal(&error),
            error => ApiError::new(problem::INVALID_GEOMETRY, format!("target: {error}")),
        })?;
        drop(samples);
        warnings.extend(design.warnings);
        let cage = Cage::new(design.cage);
        let cage = cage.map_err(|error| ApiError::new(problem::INVALID_GEOMETRY, format!("target: {error}")))?;
        enter(TransferStage::Encoding);
        let output = Target::Replacing(workshop.path().join("capture.cager"));
        let encoding = Encoding {
            output: &output,
            system: &MeanValue,
            goal: valid.goal,
            // The cage does not hold all of the motion.
            offsets: true,
            origin: job.meta.origin,
            units,
            exact_rest: options.exact_rest,
        };
        let stopped = || self.is_stopped(job);
        let mut frames = Stoppable { frames: &mut frames, stopped: &stopped, timing: (None, None) };
        let written = || {
            let Encoded { report: encoded, container } =
                encoding.write((target, &cage), &mut frames, &|_: EncodeProgress| ())?;
            container.commit()?;
            workshop.write("report.json", &json_file(&report)?)?;
            let files = vec![workshop.described("capture.cager")?, workshop.described("report.json")?];
            Ok::<_, ResultsError>((files, encoded.warnings))
        };
        let (files, more) = written().map_err(|error| ApiError::from(&error))?;
        warnings.extend(more);
        let cage_vertices = cage.vertices().len() as u32;
        Ok(Finished { frames: report.frames as u32, cage_vertices, warnings, files })
    }
}

/// The source of a transfer: at rest, its cage, its frames, with their rate and numbers where another file has these.
struct Source {
    rest: Model,
    cage: Option<Cage>,
    frames: Box<dyn FrameReader>,
    frame_rate: Option<f64>,
    numbers: Vec<f64>,
}

impl Source {
    /// Of a rest pose and frames.
    fn of_files(rest: Model, frames: Box<dyn FrameReader>) -> Self {
        let numbers = (0..frames.frames()).map(|frame| frames.number(frame)).collect();
        Self { rest, cage: None, frame_rate: frames.frame_rate(), numbers, frames }
    }

    /// Of a container, whose frames are decoded into a folder.
    fn of_container(path: &Path, scratch: &Path) -> Result<Self, ApiError> {
        let unreadable = |error: DecodeError| {
            if let DecodeError::Formats(_) | DecodeError::Memory { .. } = error {
                return ApiError::internal(&error);
            }
            ApiError::new(problem::INVALID_GEOMETRY, format!("source: {}", error.without(path)))
        };
        let MotionFile { rest, cage, numbers, frame_rate } = MotionFile::open(path).map_err(unreadable)?;
        let frames = decoded(path, rest.points.len(), scratch).map_err(unreadable)?;
        Ok(Self { rest, cage: Some(cage), frames, frame_rate, numbers })
    }
}

/// The response for a motion that cannot be moved.
fn refused(error: &TransferFailed, meta: &TransferMeta) -> ApiError {
    use TransferError::{Ambiguous, FrameNotFinite, FramePoints, Stopped};
    match error {
        TransferFailed::Formats(cager_formats::Error::Io { .. }) | TransferFailed::Transfer(Stopped) => {
            ApiError::internal(error)
        }
        TransferFailed::Formats(_) | TransferFailed::NoFrames => {
            let part = meta.parts.get_key_value(SOURCE).or_else(|| meta.parts.get_key_value(SOURCE_FRAMES));
            let place = part.map_or_else(String::new, |(name, file)| format!("{name}: {}: ", file.name));
            ApiError::new(problem::INVALID_FRAME, format!("{place}{error}"))
        }
        TransferFailed::Transfer(FrameNotFinite { .. } | FramePoints { .. }) => {
            ApiError::new(problem::INVALID_FRAME, error.to_string())
        }
        TransferFailed::Transfer(Ambiguous(up)) => {
            let fields = if *up { "align, matrix, pairs" } else { "up, align, matrix, pairs" };
            ApiError::new(problem::INVALID_GEOMETRY, format!("{error} ({fields})"))
        }
        _ => ApiError::new(problem::INVALID_GEOMETRY, error.to_string()),
    }
}
