//! Encoding: solves one cage per frame and measures the errors that a decoder will produce.

mod batches;
mod sink;

use crate::capture::{CaptureWriter, Encoding};
use crate::coding::{Carried, CodingError, Goal, GroupCoder, GroupDecoder, GroupSpace, HELD, RestMeshes, group_frames};
use crate::memory::{Memory, free_bytes};
use crate::preparation_warnings::held_frames;
use crate::speed::StepClock;
use batches::{Batch, BatchPlan, SolvedBatch, read_batches, solve};
use cager_core::cage::Cage;
use cager_core::coordinates::CoordinateSystem;
use cager_core::inversion::{Analysis, PrepareContext, PrepareError, Solver, SolverOptions, Step};
use cager_formats::{Action, AtomicFile, FrameReader, Target};
use cager_geometry::linalg::SparseMatrix;
use cager_geometry::mesh::{Model, Point, diagonal};
use cager_geometry::units::Units;
use cager_proto::container;
use cager_proto::report::{Consistency, Report, Seconds, SpectrumChoice};
use rayon::prelude::*;
use sink::{FrameSink, SinkError};
use std::io::{BufWriter, Write};
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::mpsc::sync_channel;
use std::time::Instant;

/// Largest memory of sampled frames, in bytes; constant, because the choice that depends on them must be reproducible.
const SAMPLE_BYTES: usize = 640 << 20;

/// Why encoding stopped; nothing was written.
#[derive(Debug, thiserror::Error)]
pub enum EncodeError {
    /// The rest pose and its cage cannot be used.
    #[error(transparent)]
    Prepare(#[from] PrepareError),
    /// The frames could not be read, or the output not be created.
    #[error(transparent)]
    Formats(#[from] cager_formats::Error),
    /// The frames cannot be coded as asked for.
    #[error(transparent)]
    Coding(#[from] CodingError),
    /// The frames end before they should.
    #[error("ends after {found} frames where {announced} are announced; get the capture again")]
    EndsEarly {
        /// Frames that could be read.
        found: usize,
        /// Frames that the reader announced.
        announced: usize,
    },
    /// The container could not be written.
    #[error("{}: {cause}", .path.display())]
    Container {
        /// The output.
        path: PathBuf,
        /// What went wrong; part of the message, so not a source as well.
        cause: container::Error,
    },
}

impl EncodeError {
    fn container(path: &Path, cause: container::Error) -> Self {
        let path = path.to_owned();
        match cause {
            // What `AtomicFile` passes through `io::Write` has the path in it already.
            container::Error::Io(io) => match io.downcast() {
                Ok(named) => Self::Formats(named),
                Err(io) => Self::Formats(cager_formats::Error::Io { path, action: Action::Write, cause: io }),
            },
            cause => Self::Container { path, cause },
        }
    }
}

/// Everything an encoding needs.
pub struct Job<'a> {
    /// Model in its rest pose.
    pub rest: &'a Model,
    /// Checked cage around it.
    pub cage: &'a Cage,
    /// The capture.
    pub frames: &'a mut dyn FrameReader,
    /// Where to write.
    pub output: &'a Target,
    /// Coordinate system.
    pub system: &'a dyn CoordinateSystem,
    /// Solver options.
    pub options: SolverOptions,
    /// The user's own matrix, for [`Regularizer::Matrix`](cager_core::regularize::Regularizer::Matrix).
    pub matrix: Option<&'a SparseMatrix>,
    /// Selects the spectrum threshold; without it that of the options is used.
    pub choose: Option<ChooseSpectrum>,
    /// What the encoding may hold in memory.
    pub memory: Memory,
    /// What the file is to meet; without it frames are stored as they are solved for.
    pub goal: Option<Goal>,
    /// What was subtracted from rest pose, cage and frames, and is added to them again when the file is decoded.
    pub origin: Option<Point>,
    /// What positions mean, as far as it is known.
    pub units: Units,
    /// Whether the rest pose and the cage are stored as they are also where a goal would allow less.
    pub exact_rest: bool,
}

/// How to select a spectrum threshold.
pub struct ChooseSpectrum {
    /// Some frames of the capture, at least one: see [`sample_frames`].
    pub samples: Vec<Vec<f64>>,
    /// Largest extra L2 error, as a fraction of that at threshold 0.
    pub bound: f64,
}

/// Reads at most `most` frames, evenly spaced or the first ones; fewer if memory is limited.
///
/// # Errors
/// Those of the reader, also where it ends before the frames it announced.
pub fn sample_frames(
    frames: &mut dyn FrameReader,
    most: usize,
    first_ones: bool,
) -> Result<Vec<Vec<f64>>, EncodeError> {
    let total = frames.frames();
    let count = most.min(SAMPLE_BYTES / (24 * frames.points().max(1))).clamp(1, total.max(1));
    let mut samples = Vec::with_capacity(count);
    let mut at = 0;
    for k in 0..count {
        let wanted = match count {
            _ if first_ones => k,
            1 => total / 2,
            _ => k * (total - 1) / (count - 1),
        };
        while at < wanted && frames.skip()? {
            at += 1;
        }
        let mut frame = Vec::new();
        if at < wanted || !frames.read_next(&mut frame)? {
            return Err(EncodeError::EndsEarly { found: at, announced: total });
        }
        at += 1;
        samples.push(frame);
    }
    Ok(samples)
}

/// Result of an encoding.
#[derive(Debug)]
pub struct Encoded {
    /// Report of the encoding.
    pub report: Report,
    /// The container, complete but for its name, so that a report can take its name together with it: see
    /// [`cager_formats::commit_together`].
    pub container: AtomicFile,
}

/// Progress of an encoding.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum EncodeProgress {
    /// What is prepared next.
    Preparing(&'static str),
    /// So many frames are done.
    Frames(usize),
}

/// Encodes a capture into one container.
///
/// # Errors
/// See [`EncodeError`].
pub fn encode(job: Job<'_>, progress: &dyn Fn(EncodeProgress)) -> Result<Encoded, EncodeError> {
    let clock = Instant::now();
    let path = job.output.path();
    let fail = |cause| EncodeError::container(path, cause);
    // First, so that an unwritable output fails before the work.
    let file = AtomicFile::create(job.output)?;
    let clock_code = Instant::now();
    let meshes =
        job.goal.filter(|_| !job.exact_rest).and_then(|goal| RestMeshes::new(goal, job.rest, job.cage, job.system));
    let mut code_seconds = clock_code.elapsed().as_secs_f64();
    let (given, stored) =
        (diagonal(&job.rest.points), meshes.as_ref().map(|meshes| diagonal(&meshes.rest.mesh.points)));
    // A bound holds in the unit of the rest pose that was given, and in that of the one that is stored.
    let unit = stored.map_or(given, |stored| stored.min(given));
    let (rest, cage) = meshes.as_ref().map_or((job.rest, job.cage), |meshes| (&meshes.rest.mesh, &meshes.checked));
    let Job { frames, output, system, options, matrix, choose, memory, goal, origin, units, exact_rest, .. } = job;
    let frames = &mut *frames;
    let job =
        Job { rest, cage, frames, output, system, options, matrix, choose, memory, goal, origin, units, exact_rest };
    // What groups are coded in needs nothing of the solver, unless the coordinates are a numerical solution.
    let begins_early = goal.is_some() && system.pointwise().is_some();
    let clock_prepare = Instant::now();
    let (prepared, space) = std::thread::scope(|scope| {
        let space = begins_early.then(|| scope.spawn(|| GroupSpace::new(system, cage, rest, None)));
        let prepared = prepare(&job, &|step| progress(EncodeProgress::Preparing(step)));
        (prepared, space.map(|space| space.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic))))
    });
    let (solver, options, choice, [coordinates, maxvol, svd]) = prepared?;
    let mut seconds = Seconds { coordinates, maxvol, svd, ..Seconds::default() };
    if begins_early {
        // What was waited for after the solver was there.
        let prepared = seconds.coordinates + seconds.maxvol + seconds.svd;
        code_seconds += (clock_prepare.elapsed().as_secs_f64() - prepared).max(0.0);
    }
    let clock_code = Instant::now();
    let model = match (goal, space) {
        (None, _) => None,
        (Some(_), Some(space)) => Some(GroupDecoder::in_space(space?, &solver)),
        (Some(_), None) => Some(GroupDecoder::new(system, cage, rest, &solver)?),
    };
    code_seconds += clock_code.elapsed().as_secs_f64();
    let encoding = Encoding {
        rest: job.rest,
        cage: job.cage,
        system: job.system,
        options,
        solver: &solver,
        frame_rate: job.frames.frame_rate(),
        origin: job.origin,
        units: job.units,
    };
    let coded = meshes.as_ref().map(|meshes| (&meshes.rest, &meshes.cage));
    let out = BufWriter::with_capacity(1 << 20, file);
    let mut writer = CaptureWriter::with_meshes(out, &encoding, coded).map_err(fail)?;
    let group_frames = group_frames(job.rest.points.len(), solver.decoder().unknowns());
    let group_frames = job.memory.frames(HELD * job.rest.points.len(), group_frames);
    let coder = job.goal.zip(model).map(|(goal, model)| {
        let room = goal.room(writer.bytes(), job.frames.frames());
        GroupCoder::new(goal, Arc::new(model), unit, group_frames, Carried { room, ..Carried::default() })
    });
    writer.number_frames((0..job.frames.frames()).map(|frame| job.frames.number(frame)).collect());
    seconds.code = if job.goal.is_some() { code_seconds } else { 0.0 };
    let diagonal = solver.diagonal();
    let mut sink = FrameSink {
        writer,
        coder,
        seconds,
        convergence: Vec::new(),
        held: Vec::new(),
        worst: None,
        frames: 0,
        diagonal,
    };
    send_frames(
        &solver,
        job.memory,
        job.frames,
        &mut sink,
        &|error| match error {
            SinkError::Coding(error) => EncodeError::Coding(error),
            SinkError::Container(cause) => fail(cause),
        },
        progress,
    )?;
    let FrameSink { mut writer, coder, mut seconds, convergence, held, worst, .. } = sink;
    let coded = job.goal.zip(coder.as_ref());
    let coding = |(goal, coder): (Goal, &GroupCoder)| {
        goal.coding(&coder.carried(), job.rest.points.len(), solver.diagonal(), group_frames)
    };
    if let Some(coding) = coded.and_then(coding) {
        writer.set_coding(coding);
    }
    let clock_write = Instant::now();
    let (buffered, mut report) = writer.finish().map_err(fail)?;
    report.spectrum_choice = choice;
    report.consistency = Consistency::new(&convergence);
    report.error.worst = worst;
    report.warnings.extend(held_frames(&held, report.frames, options.handles, job.goal.is_some()));
    let mut container = buffered.into_inner().map_err(|e| fail(container::Error::from(e.into_error())))?;
    report.set_output(container.complete()?);
    if let Some(Goal::Size(asked)) = job.goal
        && report.bytes.output > asked
    {
        return Err(CodingError::TooSmall { asked, least: report.bytes.output }.into());
    }
    seconds.write += clock_write.elapsed().as_secs_f64();
    report.seconds = Seconds { total: clock.elapsed().as_secs_f64(), ..seconds };
    Ok(Encoded { report, container })
}

/// Reads and solves all frames, and hands them over in their order.
fn send_frames<W: Write>(
    solver: &Solver,
    memory: Memory,
    frames: &mut dyn FrameReader,
    sink: &mut FrameSink<W>,
    explain: &dyn Fn(SinkError) -> EncodeError,
    progress: &dyn Fn(EncodeProgress),
) -> Result<(), EncodeError> {
    let keeps = solver.decoder().coordinates().is_some();
    let BatchPlan { size, concurrent } = BatchPlan::new(memory, frames.points(), keeps);
    // Errors of coded frames are those of what is decoded, measured by the coder.
    let measures = sink.coder.is_none();
    std::thread::scope(|scope| {
        let (full, batches) = sync_channel(concurrent);
        let (empty, recycled) = sync_channel(2 * concurrent + 2);
        let reader = scope.spawn(move || read_batches(frames, size, &full, &recycled));
        let mut previous: Option<Vec<f32>> = None;
        while let Ok(first) = batches.recv() {
            let waiting: Vec<Batch> = std::iter::once(first).chain(batches.try_iter().take(concurrent - 1)).collect();
            let solved: Vec<SolvedBatch> = if solver.follows_previous() {
                let in_order = waiting.iter().map(|batch| {
                    let solved = solve(solver, batch, previous.as_deref(), measures);
                    previous = solved.cages.last().cloned();
                    solved
                });
                in_order.collect()
            } else {
                waiting.par_iter().map(|batch| solve(solver, batch, None, measures)).collect()
            };
            for (batch, solved) in waiting.into_iter().zip(solved) {
                if let Some(unused) = sink.take(batch, solved).map_err(explain)? {
                    // The reader may have stopped already.
                    let _ = empty.send(unused);
                }
            }
            progress(EncodeProgress::Frames(sink.frames));
        }
        let outcome = reader.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic));
        sink.seconds.read += outcome?;
        sink.close_group().map_err(explain)
    })
}

/// The solver, its options, how the spectrum threshold was selected, and the seconds of [`StepClock`].
fn prepare(
    job: &Job<'_>,
    tell: &dyn Fn(&'static str),
) -> Result<(Solver, SolverOptions, Option<SpectrumChoice>, [f64; 3]), PrepareError> {
    let mut options = job.options;
    let points = &job.rest.points;
    let batches = job.frames.frames().div_ceil(BatchPlan::new(job.memory, points.len(), false).size);
    let passes = if job.choose.is_some() { usize::MAX } else { batches };
    let stores_coordinates = job.memory.keeps(points.len(), job.system.values(job.cage).columns(), passes);
    let clock = StepClock::default();
    let before_step = |step: Step| {
        clock.begin(step);
        tell(step.name());
        ControlFlow::Continue(())
    };
    let memory = free_bytes();
    let context = PrepareContext {
        matrix: job.matrix,
        stores_coordinates,
        memory,
        before_step: &before_step,
        ..PrepareContext::default()
    };
    let chosen_by = job.choose.as_ref().filter(|choose| !choose.samples.is_empty());
    let Some(ChooseSpectrum { samples, bound }) = chosen_by else {
        let solver = Solver::prepare_with(job.system, job.cage, points, options, &context)?;
        return Ok((solver, options, None, clock.seconds()));
    };
    options.regularizer.delta(job.matrix, job.cage, job.system.values(job.cage).unknowns())?;
    let analysis = Analysis::for_options(job.system, job.cage, points, options, &context)?;
    tell("threshold");
    let handle_system = analysis.handle_system(options.handles)?;
    let found = handle_system.choose_threshold(options, job.matrix, samples, *bound)?;
    options.spectrum = found.spectrum;
    let solver = handle_system.solver(options, job.matrix)?;
    Ok((solver, options, Some(SpectrumChoice::new(&found, *bound)), clock.seconds()))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Announces more frames than it has.
    struct Short {
        left: usize,
    }

    impl FrameReader for Short {
        fn points(&self) -> usize {
            1
        }

        fn frames(&self) -> usize {
            10
        }

        fn read_next(&mut self, out: &mut Vec<f64>) -> Result<bool, cager_formats::Error> {
            *out = vec![0.0; 3];
            let more = self.left > 0;
            self.left = self.left.saturating_sub(1);
            Ok(more)
        }
    }

    #[test]
    fn a_reader_that_ends_early_is_told_and_no_sample_is_empty() {
        for first_ones in [false, true] {
            for left in 0..10 {
                let error = sample_frames(&mut Short { left }, 24, first_ones).expect_err("too few frames");
                assert!(matches!(error, EncodeError::EndsEarly { found, announced: 10 } if found == left), "{error}");
            }
            assert_eq!(sample_frames(&mut Short { left: 10 }, 24, first_ones).expect("all").len(), 10);
        }
    }
}
