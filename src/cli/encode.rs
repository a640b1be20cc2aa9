//! `cager encode`: here, and what is the same where a service encodes.

use super::args::{EncodeArgs, SpectrumArg};
use super::checks::{capture_files, check_cage, check_capture, warn_of_departures};
use super::coding_args::{Unit, goal};
use super::dry_run::{read_files, size, tell_dry_run};
use super::encode_summary::{summary, write_report};
use super::outputs::Outputs;
use super::solver_options::{
    check_inversion, designed_spectrum, inversion_choices, matrix, read_cage, spectrum_bound, with_input_name,
};
use super::{design, encode_remote, grouped, human_bytes, progress, read_with_units, tell, warn};
use crate::coding::{CAGE_SIZE_FRAMES, CageSizes, Goal, InversionChoices};
use crate::design::{read_frames, report as design_report};
use crate::encode::{self, ChooseSpectrum, EncodeProgress, Encoded, Job, sample_frames};
use crate::frames::CaptureFiles;
use crate::memory::{Memory, free_bytes};
use crate::speed::seconds_to_prepare;
use anyhow::{Context, Result, bail};
use cager_cages::{DesignOptions, Style};
use cager_core::cage::Cage;
use cager_core::coordinates::{CoordinateSystem, MeanValue};
use cager_core::inversion::{PrepareError, Solver, SolverOptions, check_options};
use cager_core::regularize::Regularizer;
use cager_formats::{AtomicFile, FrameReader, Target, commit_together};
use cager_geometry::linalg::SparseMatrix;
use cager_geometry::mesh::Model;
use cager_proto::report::DesignReport;
use std::time::{Duration, Instant};

pub(super) fn run(mut args: EncodeArgs) -> Result<()> {
    let clock = Instant::now();
    let targets = Targets::new(&args)?;
    let (mut rest, said) = read_with_units(&args.rest, args.capture.checks.prim.as_deref())?;
    args.coding.said = said;
    let args = &args;
    let no_frames = [&args.rest].into_iter().chain(&args.cage);
    let mut files = capture_files(&args.capture, &args.frames, &mut rest, no_frames);
    files.selection.range = args.frames_range;
    (files.rest_units, files.metres_per_unit) = (said, args.coding.unit.map(Unit::metres));
    files.take_origin(&mut rest);
    // What is wrong with it is told before anything is computed.
    goal(&args.coding, args.cage.is_some(), &rest, 1)?;
    let cage = args
        .cage
        .as_ref()
        .map(|path| read_cage(path, args.flip_cage, (files.origin, args.coding.units())))
        .transpose()?;
    check_capture(&mut files, (&args.rest, &rest), &args.capture.checks, true)?;
    if let (Some(path), Some(cage)) = (&args.cage, &cage) {
        check_cage((path, cage.mesh()), &rest, &args.capture.checks)?;
    }
    if args.outputs.dry_run {
        dry_run(args, &targets, &files, &rest, cage.as_ref())?;
        warn_of_departures(&files);
        return Ok(());
    }
    let done = match (&args.server, &cage) {
        (None, Some(cage)) => encode_locally(args, &targets, &files, &rest, cage, None, clock),
        (None, None) => {
            // What is wrong with it is told before minutes of design.
            matrix(&args.solver)?;
            spectrum_bound(&args.solver)?;
            let clock_design = Instant::now();
            let (cage, report) = designed(args, &files, &rest)?;
            let design = Some((report, clock_design.elapsed().as_secs_f64()));
            encode_locally(args, &targets, &files, &rest, &cage, design, clock)
        }
        (Some(address), cage) => encode_remote::run(args, &targets, address, &files, &rest, cage.as_ref(), clock),
    };
    warn_of_departures(&files);
    done
}

/// Where the container goes, and the report.
pub(super) struct Targets {
    pub(super) output: Target,
    report: Option<Target>,
}

impl Targets {
    fn new(args: &EncodeArgs) -> Result<Self> {
        let inputs = [&args.rest, &args.frames].into_iter().chain(&args.cage).chain(&args.solver.regularizer_matrix);
        let mut outputs = Outputs::new(args.outputs, inputs)?;
        let output = outputs.binary(&args.output, "walk.cager")?;
        Ok(Self { output, report: args.report.as_ref().map(|path| outputs.text(path)).transpose()? })
    }

    pub(super) fn begin_report(&self) -> Result<Option<AtomicFile>> {
        Ok(self.report.as_ref().map(AtomicFile::create).transpose()?)
    }
}

/// What can be known without designing a cage and solving, and without a service.
fn dry_run(
    args: &EncodeArgs,
    targets: &Targets,
    files: &CaptureFiles,
    rest: &Model,
    cage: Option<&Cage>,
) -> Result<()> {
    let matrix = matrix(&args.solver)?;
    spectrum_bound(&args.solver)?;
    if args.server.is_some() {
        encode_remote::refuse_choosing(&args.solver)?;
    }
    let what = match cage {
        Some(cage) => {
            checked_options(args, rest, cage, matrix.as_ref())?;
            let system = args.solver.coordinates;
            let frames = read_files(files)?;
            match goal(&args.coding, args.cage.is_some(), rest, frames)? {
                None => {
                    format!("cages of {}, and the rest pose", size(frames, system.values(cage).unknowns(), "unknowns"))
                }
                Some(Goal::Size(most)) => {
                    format!("{} frames, coded, {} at the most", grouped(frames), human_bytes(most))
                }
                Some(_) => format!("{} frames, coded; how large they are only coding them tells", grouped(frames)),
            }
        }
        None => {
            design_options(args, rest.points.len())?;
            check_inversion(&args.solver)?;
            if args.server.is_some() {
                designed_spectrum(&args.solver)?;
            }
            format!("{} frames; a cage would be designed from them first", grouped(read_files(files)?))
        }
    };
    tell_dry_run(&targets.output, &what, std::slice::from_ref(&targets.report))
}

/// How a cage is designed. Mean value coordinates do without a tidy one; the others want all points inside.
pub(super) fn design_options(args: &EncodeArgs, points: usize) -> Result<DesignOptions> {
    let mean_value = args.solver.coordinates.name() == MeanValue.name();
    if args.coding.mean_error.is_some() && !mean_value {
        bail!(
            "--mean-error: is measured with mean value coordinates; give --cage-vertices, or leave --coordinates out"
        );
    }
    Ok(DesignOptions {
        goal: design::goal(args.design.cage_vertices, args.coding.mean_error, points)?,
        style: args.design.style.unwrap_or(if mean_value { Style::Free } else { Style::Editable }),
        seed: args.design.seed.unwrap_or(0),
        time_limit: args.design.time_limit.map(|s| Duration::from_secs(s.into())),
        ..DesignOptions::default()
    })
}

/// A cage from the capture itself.
fn designed(args: &EncodeArgs, files: &CaptureFiles, rest: &Model) -> Result<(Cage, DesignReport)> {
    let options = sized_design(args, files, rest)?;
    let frames = read_frames(files).map_err(|error| name_files(error, args))?;
    let design = design::design((&args.rest, rest), (&args.frames, &frames), None, &options)?;
    warn(&design.warnings);
    let report = design_report(&design, &options, frames.len());
    let cage = Cage::new(design.cage).with_context(|| args.rest.display().to_string())?;
    Ok((cage, report))
}

/// How a cage is designed, of as many vertices as suit what the file is to meet.
pub(super) fn sized_design(args: &EncodeArgs, files: &CaptureFiles, rest: &Model) -> Result<DesignOptions> {
    let mut options = design_options(args, rest.points.len())?;
    if let Some(vertices) = best_cage_size(args, files, rest)? {
        tell(&format!(
            "cages of several sizes were tried on the first frames: {vertices} vertices suit what is asked for\n"
        ))?;
        options.goal = design::goal(Some(vertices as u32), None, rest.points.len())?;
    }
    Ok(options)
}

/// How many vertices a designed cage should have for a bound or a size, where neither they nor an error of the cage are given.
fn best_cage_size(args: &EncodeArgs, files: &CaptureFiles, rest: &Model) -> Result<Option<usize>> {
    let mut reader = files.open()?;
    let total = reader.frames();
    let goal = goal(&args.coding, args.cage.is_some(), rest, total)?;
    let (Some(goal), None, None) = (goal, args.design.cage_vertices, args.coding.mean_error) else { return Ok(None) };
    let frames = sample_frames(reader.as_mut(), CAGE_SIZE_FRAMES, true).map_err(|error| name_files(error, args))?;
    let memory = args.memory.unwrap_or_else(Memory::half_of_free);
    let system = args.solver.coordinates;
    check_inversion(&args.solver)?;
    let sizes = CageSizes { goal, rest, system, frames: &frames, total, memory };
    let bar = progress::steps();
    bar.set_message("trying cages of several sizes");
    let best = sizes.best(|cage, rest| {
        let options = InversionChoices::coded(system).options(system.values(cage).unknowns());
        Solver::prepare(system, cage, &rest.points, options)
    });
    bar.finish_and_clear();
    Ok(best)
}

fn encode_locally(
    args: &EncodeArgs,
    targets: &Targets,
    files: &CaptureFiles,
    rest: &Model,
    cage: &Cage,
    design: Option<(DesignReport, f64)>,
    clock: Instant,
) -> Result<()> {
    let memory = args.memory.unwrap_or_else(Memory::half_of_free);
    let mut frames = files.open()?;
    let (system, options) = (args.solver.coordinates, solver_options(args, rest, cage)?);
    let matrix = matrix(&args.solver)?;
    let choose = match (args.solver.spectrum, spectrum_bound(&args.solver)?) {
        (Some(SpectrumArg::Auto), bound) => {
            // What is wrong with the options is told before anything is read.
            check_options(rest.points.len(), system.values(cage).unknowns(), options, free_bytes())
                .map_err(|e| name_file(&e, args))?;
            let mut again = files.open()?;
            let samples = choosing_frames(again.as_mut(), options.regularizer == Regularizer::Temporal)
                .map_err(|error| name_files(error, args))?;
            Some(ChooseSpectrum { samples, bound })
        }
        _ => None,
    };
    let report_file = targets.begin_report()?;
    // All that was done so far.
    let design_seconds = design.as_ref().map_or(0.0, |(_, seconds)| *seconds);
    let read_seconds = clock.elapsed().as_secs_f64() - design_seconds;

    let bar = progress::PreparationBar::new("encoding", frames.frames())
        .expecting(|| seconds_to_prepare(system, cage, rest.points.len()));
    let (announced, units) = (frames.frames(), frames.units());
    let job = Job {
        rest,
        cage,
        frames: frames.as_mut(),
        output: &targets.output,
        system,
        options,
        matrix: matrix.as_ref(),
        choose,
        memory,
        goal: goal(&args.coding, args.cage.is_some(), rest, announced)?,
        origin: files.origin,
        units,
        exact_rest: args.coding.exact_rest,
    };
    let result = encode::encode(job, &|told| match told {
        EncodeProgress::Preparing(step) => bar.preparing(step),
        EncodeProgress::Frames(done) => bar.done(done),
    });
    bar.finish();
    let mut encoded = result.map_err(|error| name_files(error, args))?;
    encoded.report.seconds.read += read_seconds;
    encoded.report.seconds.design = design_seconds;
    encoded.report.design = design.map(|(report, _)| report);
    finish(targets, encoded, report_file, clock)
}

/// Frames to choose a spectrum threshold by: the first ones where cages follow their predecessors.
fn choosing_frames(frames: &mut dyn FrameReader, first_ones: bool) -> Result<Vec<Vec<f64>>, encode::EncodeError> {
    sample_frames(frames, if first_ones { 96 } else { 24 }, first_ones)
}

/// What the arguments say of the inversion, and what is usual for this rest pose and cage.
fn solver_options(args: &EncodeArgs, rest: &Model, cage: &Cage) -> Result<SolverOptions> {
    let unknowns = args.solver.coordinates.values(cage).unknowns();
    // The number of frames says how large a file may be, not whether it is coded.
    let is_coded = goal(&args.coding, args.cage.is_some(), rest, 1)?.is_some();
    Ok(inversion_choices(&args.solver, is_coded, unknowns)?.options(unknowns))
}

/// [`solver_options`] for this rest pose and cage, with all checked that needs no coordinates.
pub(super) fn checked_options(
    args: &EncodeArgs,
    rest: &Model,
    cage: &Cage,
    matrix: Option<&SparseMatrix>,
) -> Result<SolverOptions> {
    let (system, options) = (args.solver.coordinates, solver_options(args, rest, cage)?);
    let unknowns = system.values(cage).unknowns();
    let delta = matrix.map_or(Ok(()), |_| Regularizer::Matrix.delta(matrix, cage, unknowns).map(|_| ()));
    // A service knows its own memory.
    let memory = if args.server.is_some() { u64::MAX } else { free_bytes() };
    delta
        .map_err(PrepareError::from)
        .and_then(|()| Solver::check(system, cage, &rest.points, options, memory))
        .map_err(|error| name_file(&error, args))?;
    Ok(options)
}

pub(super) fn finish(
    targets: &Targets,
    encoded: Encoded,
    report_file: Option<AtomicFile>,
    clock: Instant,
) -> Result<()> {
    let Encoded { mut report, container } = encoded;
    report.seconds.total = clock.elapsed().as_secs_f64();
    // A full disk shows here, before either file has its name.
    let report_file = report_file.map(|file| write_report(file, &report)).transpose()?;
    commit_together(report_file.into_iter().chain([container]).collect())?;
    warn(&report.warnings);
    tell(&summary(&report, targets.output.path()))
}

/// Errors of `core` know vertices and points; the user needs the file.
fn name_files(error: encode::EncodeError, args: &EncodeArgs) -> anyhow::Error {
    match error {
        encode::EncodeError::Prepare(inner) => name_file(&inner, args),
        error @ encode::EncodeError::EndsEarly { .. } => anyhow::anyhow!("{}: {error}", args.frames.display()),
        other => other.into(),
    }
}

fn name_file(error: &PrepareError, args: &EncodeArgs) -> anyhow::Error {
    match (error, &args.solver.regularizer_matrix) {
        (PrepareError::Term(_), Some(matrix)) => anyhow::anyhow!("{}: {error}", matrix.display()),
        _ => with_input_name(error, &args.rest, args.cage.as_deref().unwrap_or(&args.rest)),
    }
}
