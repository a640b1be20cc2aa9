//! Encoding: solves one cage per frame and measures the errors that a decoder will produce.

use crate::capture::{CaptureWriter, Encoding, StoredError};
use crate::coding::{
    Carried, CodedGroup, CodingError, Goal, GroupCoder, GroupDecoder, GroupSpace, HELD, RestMeshes, group_frames,
};
use crate::memory::Memory;
use cager_core::cage::Cage;
use cager_core::coordinates::CoordinateSystem;
use cager_core::decode::FrameError;
use cager_core::inversion::{Analysis, BATCH, Convergence, PrepareError, Preparing, Solver, SolverOptions};
use cager_core::mesh::{Model, diagonal};
use cager_core::regularize::Term;
use cager_formats::{Action, AtomicFile, FrameReader, Target};
use cager_proto::container;
use cager_proto::report::{Consistency, Report, Seconds, SpectrumChoice, WorstError};
use rayon::prelude::*;
use std::io::{BufWriter, Write};
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
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
    /// The user's own term, for [`Regularizer::Matrix`](cager_core::regularize::Regularizer::Matrix).
    pub term: Option<&'a dyn Term>,
    /// Selects the spectrum threshold; without it that of the options is used.
    pub choose: Option<ChooseSpectrum>,
    /// What the encoding may hold in memory.
    pub memory: Memory,
    /// What the file is to meet; without it frames are stored as they are solved for.
    pub goal: Option<Goal>,
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
    let explain = |error| match error {
        GroupError::Coding(error) => EncodeError::Coding(error),
        GroupError::Container(cause) => fail(cause),
    };
    // First, so that an unwritable output fails before the work.
    let file = AtomicFile::create(job.output)?;
    let meshes =
        job.goal.filter(|_| !job.exact_rest).and_then(|goal| RestMeshes::new(goal, job.rest, job.cage, job.system));
    let (given, stored) =
        (diagonal(&job.rest.points), meshes.as_ref().map(|meshes| diagonal(&meshes.rest.mesh.points)));
    // A bound holds in the unit of the rest pose that was given, and in that of the one that is stored.
    let unit = stored.map_or(given, |stored| stored.min(given));
    let (rest, cage) = meshes.as_ref().map_or((job.rest, job.cage), |meshes| (&meshes.rest.mesh, &meshes.checked));
    let Job { frames, output, system, options, term, choose, memory, goal, exact_rest, .. } = job;
    let job = Job { rest, cage, frames: &mut *frames, output, system, options, term, choose, memory, goal, exact_rest };
    // What groups are coded in needs nothing of the solver, unless the coordinates are a numerical solution.
    let begins_early = goal.is_some() && system.pointwise().is_some();
    let (prepared, space) = std::thread::scope(|scope| {
        let space = begins_early.then(|| scope.spawn(|| GroupSpace::new(system, cage, rest, None)));
        let prepared = prepare(&job, &|step| progress(EncodeProgress::Preparing(step)));
        (prepared, space.map(|space| space.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic))))
    });
    let (solver, options, choice) = prepared?;
    let model = match (goal, space) {
        (None, _) => None,
        (Some(_), Some(space)) => Some(GroupDecoder::in_space(space?, &solver)),
        (Some(_), None) => Some(GroupDecoder::new(system, cage, rest, &solver)?),
    };
    let encoding = Encoding {
        rest: job.rest,
        cage: job.cage,
        system: job.system,
        options,
        solver: &solver,
        frame_rate: job.frames.frame_rate(),
    };
    let coded = meshes.as_ref().map(|meshes| (&meshes.rest, &meshes.cage));
    let out = BufWriter::with_capacity(1 << 20, file);
    let mut writer = CaptureWriter::with_meshes(out, &encoding, coded).map_err(fail)?;
    let group_frames = group_frames(job.rest.points.len(), solver.decoder().unknowns());
    let group_frames = job.memory.frames(HELD * job.rest.points.len(), group_frames);
    let mut coder = job.goal.zip(model).map(|(goal, model)| {
        let room = goal.room(writer.bytes(), job.frames.frames());
        GroupCoder::new(goal, Arc::new(model), unit, group_frames, Carried { room, ..Carried::default() })
    });
    writer.number_frames((0..job.frames.frames()).map(|frame| job.frames.number(frame)).collect());
    let found = solver.preparation();
    let mut seconds = Seconds {
        coordinates: found.coordinates_seconds,
        maxvol: found.maxvol_seconds,
        svd: found.svd_seconds,
        ..Seconds::default()
    };
    let keeps = solver.decoder().coordinates().is_some();
    let BatchPlan { size, concurrent } = BatchPlan::new(job.memory, job.frames.points(), keeps);
    let mut convergence = Vec::new();
    let mut worst = None;
    std::thread::scope(|scope| -> Result<(), EncodeError> {
        let (full, batches) = sync_channel(concurrent);
        let (empty, recycled) = sync_channel(2 * concurrent + 2);
        let frames = job.frames;
        let reader = scope.spawn(move || read_batches(frames, size, &full, &recycled));
        let mut done = 0;
        let mut previous: Option<Vec<f32>> = None;
        while let Ok(first) = batches.recv() {
            let mut waiting = vec![first];
            while waiting.len() < concurrent {
                match batches.try_recv() {
                    Ok(batch) => waiting.push(batch),
                    Err(_) => break,
                }
            }
            let solved: Vec<SolvedBatch> = if solver.follows_previous() {
                let in_order = waiting.iter().map(|batch| {
                    let solved = solve(&solver, batch, previous.as_deref(), coder.is_none());
                    previous = solved.cages.last().cloned();
                    solved
                });
                in_order.collect()
            } else {
                waiting.par_iter().map(|batch| solve(&solver, batch, None, coder.is_none())).collect()
            };
            if let Some(coder) = &mut coder {
                for (batch, solved) in waiting.into_iter().zip(solved) {
                    seconds.invert += solved.invert_seconds;
                    convergence.extend(solved.convergence);
                    for (frame, cage) in batch.into_iter().zip(solved.cages) {
                        if coder.push(frame, cage) {
                            close(coder, &mut writer, &mut worst, &mut seconds, solver.diagonal()).map_err(&explain)?;
                        }
                        done += 1;
                    }
                }
                progress(EncodeProgress::Frames(done));
                continue;
            }
            for batch in waiting {
                // The reader may have stopped already.
                let _ = empty.send(batch);
            }
            let clock = Instant::now();
            for batch in solved {
                seconds.invert += batch.invert_seconds;
                seconds.measure += batch.measure_seconds;
                convergence.extend(batch.convergence);
                for (cage, error) in batch.cages.iter().zip(&batch.errors) {
                    if worst.is_none_or(|worst: WorstError| error.linf > worst.distance) {
                        worst = Some(WorstError { frame: done, point: Some(error.worst), distance: error.linf });
                    }
                    writer.write_frame(cage, &StoredError::new(error, solver.diagonal())).map_err(fail)?;
                    done += 1;
                }
            }
            seconds.write += clock.elapsed().as_secs_f64();
            progress(EncodeProgress::Frames(done));
        }
        let outcome = reader.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic));
        seconds.read += outcome?;
        if let Some(coder) = coder.as_mut().filter(|coder| !coder.is_empty()) {
            close(coder, &mut writer, &mut worst, &mut seconds, solver.diagonal()).map_err(&explain)?;
        }
        Ok(())
    })?;

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

/// Codes a group and writes it.
fn close<W: Write>(
    coder: &mut GroupCoder,
    writer: &mut CaptureWriter<W>,
    worst: &mut Option<WorstError>,
    seconds: &mut Seconds,
    diagonal: f64,
) -> Result<(), GroupError> {
    let clock = Instant::now();
    let CodedGroup { cages, residual, errors, farthest } = coder.close()?;
    let before = writer.frames();
    for (frame, error) in errors.iter().enumerate() {
        if worst.is_none_or(|worst| error.linf > worst.distance) {
            *worst = Some(WorstError { frame: before + frame, point: Some(error.worst), distance: error.linf });
        }
    }
    seconds.measure += clock.elapsed().as_secs_f64();
    let errors: Vec<StoredError> = errors.iter().map(|error| StoredError::new(error, diagonal)).collect();
    Ok(writer.write_group(&cages, residual.as_deref(), &errors, farthest)?)
}

/// Why a group is not in the file.
#[derive(Debug, thiserror::Error)]
enum GroupError {
    #[error(transparent)]
    Coding(#[from] CodingError),
    #[error(transparent)]
    Container(#[from] container::Error),
}

/// The solver, its options, and how the spectrum threshold was selected.
fn prepare(
    job: &Job<'_>,
    tell: &dyn Fn(&'static str),
) -> Result<(Solver, SolverOptions, Option<SpectrumChoice>), PrepareError> {
    let mut options = job.options;
    let points = &job.rest.points;
    let batches = job.frames.frames().div_ceil(BatchPlan::new(job.memory, points.len(), false).size);
    let passes = if job.choose.is_some() { usize::MAX } else { batches };
    let stores_coordinates = job.memory.keeps(points.len(), job.system.columns(job.cage), passes);
    let next = |step| {
        tell(step);
        ControlFlow::Continue(())
    };
    let preparing = Preparing { term: job.term, stores_coordinates, next: &next, ..Preparing::default() };
    let term = preparing.term(options)?;
    let chosen_by = job.choose.as_ref().filter(|choose| !choose.samples.is_empty());
    let Some(ChooseSpectrum { samples, bound }) = chosen_by else {
        return Ok((Solver::prepare_with(job.system, job.cage, points, options, &preparing)?, options, None));
    };
    term.delta(job.cage, job.system.unknowns(job.cage))?;
    let analysis = Analysis::for_options(job.system, job.cage, points, options, &preparing)?;
    tell("threshold");
    let handle_system = analysis.handle_system(options.handles)?;
    let found = handle_system.choose_threshold(options, term, samples, *bound)?;
    options.spectrum = found.spectrum;
    Ok((handle_system.solver_with(options, term)?, options, Some(SpectrumChoice::new(&found, *bound))))
}

type Batch = Vec<Vec<f64>>;

/// Batch size and number of batches solved concurrently. As many again are queued, and one is being read.
#[derive(Clone, Copy, Debug, PartialEq)]
struct BatchPlan {
    size: usize,
    concurrent: usize,
}

impl BatchPlan {
    /// With coordinates in memory, one batch per thread; otherwise one batch, since computing coordinates uses all threads.
    fn new(memory: Memory, points: usize, keeps: bool) -> Self {
        let most = if keeps { rayon::current_num_threads() } else { 1 };
        let frames = memory.frames(24 * points, BATCH * (2 * most + 1));
        let concurrent = (frames.saturating_sub(1) / 2).clamp(1, most);
        Self { size: (frames / (2 * concurrent + 1)).max(1), concurrent }
    }
}

/// Reads all frames; returns the seconds spent reading, without waiting for the solver.
fn read_batches(
    frames: &mut dyn FrameReader,
    size: usize,
    full: &SyncSender<Batch>,
    recycled: &Receiver<Batch>,
) -> Result<f64, cager_formats::Error> {
    let mut seconds = 0.0;
    loop {
        let clock = Instant::now();
        let mut batch = recycled.try_recv().unwrap_or_default();
        let mut filled = 0;
        while filled < size {
            if filled == batch.len() {
                batch.push(Vec::new());
            }
            if !frames.read_next(&mut batch[filled])? {
                break;
            }
            filled += 1;
        }
        batch.truncate(filled);
        seconds += clock.elapsed().as_secs_f64();
        if batch.is_empty() || full.send(batch).is_err() {
            return Ok(seconds);
        }
    }
}

struct SolvedBatch {
    cages: Vec<Vec<f32>>,
    errors: Vec<FrameError>,
    /// Empty where nothing was iterated.
    convergence: Vec<Convergence>,
    invert_seconds: f64,
    measure_seconds: f64,
}

/// Solves a batch; `previous` is the cage of the frame before its first, `measures` whether errors are measured on these cages.
fn solve(solver: &Solver, batch: &Batch, previous: Option<&[f32]>, measures: bool) -> SolvedBatch {
    let frames: Vec<&[f64]> = batch.iter().map(Vec::as_slice).collect();
    let clock = Instant::now();
    let inverted = solver.invert_with_convergence(previous, &frames);
    let invert_seconds = clock.elapsed().as_secs_f64();
    let convergence = inverted.iter().filter_map(|inverted| inverted.convergence).collect();
    let cages: Vec<Vec<f32>> = inverted.into_iter().map(|inverted| inverted.cage).collect();
    let views: Vec<&[f32]> = cages.iter().map(Vec::as_slice).collect();
    let errors = if measures { solver.decoder().measure(&views, &frames) } else { Vec::new() };
    let measure_seconds = clock.elapsed().as_secs_f64() - invert_seconds;
    SolvedBatch { cages, errors, convergence, invert_seconds, measure_seconds }
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
    fn frames_on_their_way_fit_into_memory_with_any_number_of_threads() {
        for threads in [1, 2, 64] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
            for (points, keeps) in [(100, true), (100, false), (1_000_000, true), (1_000_000, false)] {
                let BatchPlan { size, concurrent } =
                    pool.install(|| BatchPlan::new(Memory::at_most(1 << 30), points, keeps));
                let most = (24 * points * size * (2 * concurrent + 1)) as u64;
                assert!(
                    (1..=BATCH).contains(&size) && concurrent >= 1 && most <= 1 << 28,
                    "{threads} {points}: {most}"
                );
                assert!(points > 100 || size == BATCH && concurrent == if keeps { threads } else { 1 });
            }
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
