//! The encoder: frames in, one by one or from a reader, a container out.

use super::batches::{Batch, BatchPlan, SolvedBatch, read_batches, solve};
use super::options::Encode;
use super::sink::FrameSink;
use super::{ChooseSpectrum, EncodeError, EncodeProgress, Encoded};
use crate::capture::{CaptureWriter, Encoding};
use crate::coding::{
    BYTES_PER_POSITION, Carried, CodingError, Goal, GroupCoder, GroupDecoder, GroupSpace, RestMeshes, group_frames,
};
use crate::frames::CaptureFiles;
use crate::memory::{Memory, free_bytes};
use crate::positions::not_single;
use crate::preparation_warnings::held_frames;
use crate::speed::StepClock;
use cager_core::cage::Cage;
use cager_core::inversion::{BATCH, PrepareContext, PrepareError, Solver, SolverOptions, Step, reject_carriers};
use cager_core::spectral::Analysis;
use cager_formats::{AtomicFile, FrameReader, Target};
use cager_geometry::mesh::{Model, Point, diagonal};
use cager_proto::container;
use cager_proto::report::{Consistency, Report, Seconds, SpectrumChoice};
use rayon::prelude::*;
use std::io::BufWriter;
use std::ops::ControlFlow;
use std::sync::Arc;
use std::sync::mpsc::sync_channel;
use std::time::Instant;

/// Encodes frames as they arrive: made by [`Encode::start`].
pub struct Encoder {
    solver: Solver,
    options: SolverOptions,
    choice: Option<SpectrumChoice>,
    goal: Option<Goal>,
    group_frames: usize,
    sink: FrameSink<BufWriter<AtomicFile>>,
    clock: Instant,
    /// Frames that were pushed and are not solved yet.
    waiting: Batch,
    /// Cage of the frame solved last.
    previous: Option<Vec<f32>>,
    /// Whether frames that were taken could not be encoded, so that the file would lack them.
    has_failed: bool,
}

impl<Files> Encode<'_, Files> {
    /// Encodes these frames; the container is complete but for its name.
    ///
    /// # Errors
    /// See [`EncodeError`].
    pub fn run(self, frames: &mut dyn FrameReader, output: &Target) -> Result<Encoded, EncodeError> {
        let (memory, progress) = (self.memory_limit(), self.progress);
        let numbers = (0..frames.frames()).map(|frame| frames.number(frame)).collect();
        let job = self.expect_frames(frames.frames());
        let mut encoder = Encoder::begin(&job, output, (frames.frame_rate(), numbers))?;
        encoder.push_all(frames, memory, progress)?;
        encoder.complete()
    }
}

impl Encode<'_> {
    /// Prepares for frames that are pushed one by one into a container at `output`.
    ///
    /// # Errors
    /// See [`EncodeError`].
    pub fn start(self, output: impl Into<Target>) -> Result<Encoder, EncodeError> {
        if matches!(self.goal, Some(Goal::Size(_))) && self.expected.is_none() {
            return Err(EncodeError::UnknownLength);
        }
        Encoder::begin(&self, &output.into(), (None, Vec::new()))
    }
}

impl Encode<'_, &CaptureFiles> {
    /// Encodes all frames into a container at `output`, which appears complete or not at all.
    ///
    /// # Errors
    /// See [`EncodeError`].
    pub fn write(self, output: impl Into<Target>) -> Result<Report, EncodeError> {
        let mut frames = self.files.open()?;
        let units = frames.units();
        self.units(units).run(frames.as_mut(), &output.into())?.commit()
    }
}

impl Encoder {
    /// Prepares for frames of this rate and these numbers, 0, 1, 2, … where there are none.
    pub(super) fn begin<F>(
        job: &Encode<'_, F>,
        output: &Target,
        (frame_rate, numbers): (Option<f64>, Vec<f64>),
    ) -> Result<Self, EncodeError> {
        let clock = Instant::now();
        let path = output.path().to_owned();
        let fail = |cause| EncodeError::container(&path, cause);
        // First, so that an unwritable output fails before the work.
        let file = AtomicFile::create(output)?;
        let (system, goal) = (job.system, job.goal);
        // Before all that takes the coordinates of points.
        reject_carriers(system, job.cage, job.rest.points.len()).map_err(PrepareError::from)?;
        let clock_code = Instant::now();
        let meshes =
            goal.filter(|_| !job.exact_rest).and_then(|goal| RestMeshes::new(goal, job.rest, job.cage, system));
        let mut code_seconds = clock_code.elapsed().as_secs_f64();
        let (given, stored) =
            (diagonal(&job.rest.points), meshes.as_ref().map(|meshes| diagonal(&meshes.rest.mesh.points)));
        // A bound holds by the diagonals of the given rest pose and of the stored one.
        let unit = stored.map_or(given, |stored| stored.min(given));
        let (rest, cage) = meshes.as_ref().map_or((job.rest, job.cage), |meshes| (&meshes.rest.mesh, &meshes.checked));
        // What groups are coded in needs nothing of the solver, unless the coordinates are a
        // numerical solution.
        let begins_early = goal.is_some() && system.pointwise().is_some();
        let clock_prepare = Instant::now();
        let (prepared, space) = std::thread::scope(|scope| {
            let space = begins_early.then(|| scope.spawn(|| GroupSpace::new(system, cage, rest, None)));
            let prepared = prepare(job, rest, cage);
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
        seconds.code = if goal.is_some() { code_seconds } else { 0.0 };
        let (origin, units) = (job.origin, job.units);
        let encoding = Encoding { rest, cage, system, options, solver: &solver, frame_rate, origin, units };
        let coded = meshes.as_ref().map(|meshes| (&meshes.rest, &meshes.cage));
        let out = BufWriter::with_capacity(1 << 20, file);
        let mut writer = CaptureWriter::new(out, &encoding, coded).map_err(fail)?;
        let points = rest.points.len();
        let group_frames = group_frames(points, solver.decoder().unknowns());
        let group_frames = job.memory_limit().frames(BYTES_PER_POSITION * points, group_frames);
        let coder = goal.zip(model).map(|(goal, model)| {
            let room = goal.room(writer.bytes(), job.expected.unwrap_or(0));
            GroupCoder::new(goal, Arc::new(model), unit, group_frames, Carried { room, ..Carried::default() })
        });
        writer.number_frames(numbers);
        let diagonal = solver.diagonal();
        let sink = FrameSink {
            writer,
            coder,
            seconds,
            convergence: Vec::new(),
            held: Vec::new(),
            worst: None,
            frames: 0,
            diagonal,
            path,
        };
        let (waiting, previous, has_failed) = (Vec::new(), None, false);
        Ok(Self { solver, options, choice, goal, group_frames, sink, clock, waiting, previous, has_failed })
    }

    /// Takes the next frame: every point of the rest pose, in its order.
    ///
    /// # Errors
    /// [`EncodeError::PointCount`] and [`EncodeError::NotFinite`], after which another frame may be
    /// given in place of this one; those of the coding and the output, after which every call
    /// returns [`EncodeError::Stopped`].
    pub fn push(&mut self, frame: &[Point]) -> Result<(), EncodeError> {
        self.check_complete()?;
        let (number, expected) = (self.sink.frames + self.waiting.len(), self.solver.decoder().points());
        if frame.len() != expected {
            return Err(EncodeError::PointCount { frame: number, found: frame.len(), expected });
        }
        if let Some(point) = not_single(frame) {
            return Err(EncodeError::NotFinite { frame: number, point });
        }
        self.waiting.push(frame.as_flattened().to_vec());
        if self.waiting.len() == BATCH { self.solve_waiting() } else { Ok(()) }
    }

    /// Solves what waits, gives the container its name, and returns the report.
    ///
    /// # Errors
    /// Those of the coding and the output; [`EncodeError::Stopped`] after such an error.
    pub fn finish(self) -> Result<Report, EncodeError> {
        self.complete()?.commit()
    }

    /// As [`Self::finish`], but for the container's name.
    ///
    /// # Errors
    /// As [`Self::finish`].
    pub fn complete(mut self) -> Result<Encoded, EncodeError> {
        self.check_complete()?;
        self.solve_waiting()?;
        self.sink.close_group()?;
        let Self { solver, options, choice, goal, group_frames, sink, clock, .. } = self;
        let FrameSink { mut writer, coder, mut seconds, convergence, held, worst, path, .. } = sink;
        let fail = |cause| EncodeError::container(&path, cause);
        let coding = goal.zip(coder.as_ref()).and_then(|(goal, coder)| {
            goal.coding(&coder.carried(), solver.decoder().points(), solver.diagonal(), group_frames)
        });
        if let Some(coding) = coding {
            writer.set_coding(coding);
        }
        let clock_write = Instant::now();
        let (buffered, mut report) = writer.finish().map_err(fail)?;
        report.spectrum_choice = choice;
        report.consistency = Consistency::new(&convergence);
        report.error.worst = worst;
        report.warnings.extend(held_frames(&held, report.frames, options.handles, goal.is_some()));
        let mut container = buffered.into_inner().map_err(|e| fail(container::Error::from(e.into_error())))?;
        report.set_output(container.complete()?);
        if let Some(Goal::Size(asked)) = goal
            && report.bytes.output > asked
        {
            return Err(CodingError::TooSmall { asked, least: report.bytes.output }.into());
        }
        seconds.write += clock_write.elapsed().as_secs_f64();
        report.seconds = Seconds { total: clock.elapsed().as_secs_f64(), ..seconds };
        Ok(Encoded { report, container })
    }

    fn solve_waiting(&mut self) -> Result<(), EncodeError> {
        if self.waiting.is_empty() {
            return Ok(());
        }
        let batch = std::mem::take(&mut self.waiting);
        let solved = solve(&self.solver, &batch, self.previous.as_deref(), self.sink.coder.is_none());
        self.previous = solved.cages.last().filter(|_| self.solver.follows_previous()).cloned();
        let taken = self.sink.take(batch, solved).map(drop);
        self.has_failed = taken.is_err();
        taken
    }

    /// Refuses to go on where frames would be missing.
    fn check_complete(&self) -> Result<(), EncodeError> {
        if self.has_failed { Err(EncodeError::Stopped { frame: self.sink.writer.frames() }) } else { Ok(()) }
    }

    /// Reads and solves all frames of a reader, several batches at a time.
    pub(super) fn push_all(
        &mut self,
        frames: &mut dyn FrameReader,
        memory: Memory,
        progress: &dyn Fn(EncodeProgress),
    ) -> Result<(), EncodeError> {
        let keeps = self.solver.decoder().coordinates().is_some();
        let BatchPlan { size, concurrent } = BatchPlan::new(memory, frames.points(), keeps);
        // Errors of coded frames are those of what is decoded, measured by the coder.
        let measures = self.sink.coder.is_none();
        std::thread::scope(|scope| {
            let (full, batches) = sync_channel(concurrent);
            let (empty, recycled) = sync_channel(2 * concurrent + 2);
            let reader = scope.spawn(move || read_batches(frames, size, &full, &recycled));
            while let Ok(first) = batches.recv() {
                let waiting: Vec<Batch> =
                    std::iter::once(first).chain(batches.try_iter().take(concurrent - 1)).collect();
                let solver = &self.solver;
                let solved: Vec<SolvedBatch> = if solver.follows_previous() {
                    let in_order = waiting.iter().map(|batch| {
                        let solved = solve(solver, batch, self.previous.as_deref(), measures);
                        self.previous = solved.cages.last().cloned();
                        solved
                    });
                    in_order.collect()
                } else {
                    waiting.par_iter().map(|batch| solve(solver, batch, None, measures)).collect()
                };
                for (batch, solved) in waiting.into_iter().zip(solved) {
                    if let Some(unused) = self.sink.take(batch, solved)? {
                        // The reader may have stopped already.
                        let _ = empty.send(unused);
                    }
                }
                progress(EncodeProgress::Frames(self.sink.frames));
            }
            let outcome = reader.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic));
            self.sink.seconds.read += outcome?;
            Ok(())
        })
    }
}

/// The solver, its options, how the spectrum threshold was selected, and the seconds of
/// [`StepClock`].
fn prepare<F>(
    job: &Encode<'_, F>,
    rest: &Model,
    cage: &Cage,
) -> Result<(Solver, SolverOptions, Option<SpectrumChoice>, [f64; 3]), PrepareError> {
    let mut options = job.solver_options();
    let (system, points, memory) = (job.system, &rest.points, job.memory_limit());
    let size = BatchPlan::new(memory, points.len(), false).size;
    let batches = job.expected.map_or(usize::MAX, |frames| frames.div_ceil(size));
    let passes = if job.choose.is_some() { usize::MAX } else { batches };
    let stores_coordinates = memory.keeps(points.len(), system.values(cage).columns(), passes);
    let clock = StepClock::default();
    let before_step = |step: Step| {
        clock.begin(step);
        (job.progress)(EncodeProgress::Preparing(step.name()));
        ControlFlow::Continue(())
    };
    let context = PrepareContext {
        matrix: job.matrix,
        stores_coordinates,
        memory: free_bytes(),
        before_step: &before_step,
        ..PrepareContext::default()
    };
    let chosen_by = job.choose.as_ref().filter(|choose| !choose.samples.is_empty());
    let Some(ChooseSpectrum { samples, bound }) = chosen_by else {
        let solver = Solver::prepare_with(system, cage, points, options, &context)?;
        return Ok((solver, options, None, clock.seconds()));
    };
    options.regularizer.delta(job.matrix, cage, system.values(cage).unknowns())?;
    let analysis = Analysis::for_options(system, cage, points, options, &context)?;
    (job.progress)(EncodeProgress::Preparing("threshold"));
    let handle_system = analysis.handle_system(options.handles)?;
    let found = handle_system.choose_threshold(options, job.matrix, samples, *bound)?;
    options.spectrum = found.spectrum;
    let solver = handle_system.solver(options, job.matrix)?;
    Ok((solver, options, Some(SpectrumChoice::new(&found, *bound)), clock.seconds()))
}
